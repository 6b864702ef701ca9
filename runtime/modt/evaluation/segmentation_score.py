"""How many labelled objects segmentation finds, and what became of the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.evaluation.rows import Outcome, Rows, kinds
from modt.evaluation.truth import Role


@dataclass(frozen=True, slots=True)
class SegmentationScore:
    """Objects of one kind, one count an object and frame.

    Attributes:
        objects: judged.
        recall: share of them that is found.
        merged, split, partial, missed: of those not found (`Outcome`).
        cut: objects of which most is out of view, judged or not.
    """

    objects: int
    recall: float | None
    merged: int
    split: int
    partial: int
    missed: int
    cut: int


def segmentation(objects: Rows) -> dict[str, SegmentationScore]:
    """The score of each class and of each labelled type."""
    scores = {}
    for name, which in kinds(objects).items():
        judged = objects["outcome"][which & objects["to_segment"]]
        found, merged, split, partial, missed = np.bincount(judged, minlength=len(Outcome)).tolist()
        cut = int((which & ~objects["in_view"] & (objects["role"] != Role.IGNORED)).sum())
        if len(judged) or cut:
            recall = found / len(judged) if len(judged) else None
            scores[name] = SegmentationScore(len(judged), recall, merged, split, partial, missed, cut)
    return scores
