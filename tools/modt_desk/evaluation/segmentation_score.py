"""Recall of segmentation, and the outcomes of the objects that it misses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt_desk.evaluation.rows import Outcome, Rows, kinds, ratio
from modt_desk.evaluation.truth import LABELLED


@dataclass(frozen=True, slots=True)
class SegmentationScore:
    """Objects of one kind, one count an object and frame; merged to missed are those not detected (`Outcome`)."""

    objects: int  # judged
    recall: float | None  # share of them that is detected
    merged: int
    split: int
    partial: int
    missed: int
    cut: int  # most is out of view, judged or not


def segmentation(objects: Rows) -> dict[str, SegmentationScore]:
    """The score of each class and of each labelled type."""
    scores = {}
    for name, which in kinds(objects).items():
        judged = objects["outcome"][which & objects["to_segment"]]
        found, merged, split, partial, missed = np.bincount(judged, minlength=len(Outcome)).tolist()
        cut = int((which & ~objects["in_view"] & np.isin(objects["role"], LABELLED)).sum())
        if len(judged) or cut:
            recall = ratio(found, len(judged))
            scores[name] = SegmentationScore(len(judged), recall, merged, split, partial, missed, cut)
    return scores
