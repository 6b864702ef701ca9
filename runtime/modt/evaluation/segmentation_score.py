"""How many labelled objects segmentation finds, and what became of the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.evaluation.rows import ObjectRows, Outcome
from modt.types import CLASS_NAMES


@dataclass(frozen=True, slots=True)
class SegmentationScore:
    """Objects of one kind, one count an object and frame.

    Attributes:
        objects: judged.
        recall: share of them that is found.
        merged, split, partial, missed: of those not found (`Outcome`).
        cut: by the view, counted apart where they are ignored.
    """

    objects: int
    recall: float | None
    merged: int
    split: int
    partial: int
    missed: int
    cut: int

    @classmethod
    def of(cls, rows: ObjectRows) -> SegmentationScore:
        """The score of some objects."""
        outcome = rows.outcome[rows.to_segment]
        found, merged, split, partial, missed = np.bincount(outcome, minlength=len(Outcome)).tolist()
        recall = found / len(outcome) if len(outcome) else None
        return cls(len(outcome), recall, merged, split, partial, missed, int(rows.cut.sum()))


def segmentation(rows: ObjectRows) -> dict[str, SegmentationScore]:
    """By class, of counted objects, and by labelled type, of all."""
    groups = {name: (rows.object_class == c) & (rows.role == 0) for c, name in enumerate(CLASS_NAMES) if c}
    groups |= {name: rows.type_ == name for name in sorted(set(rows.type_.tolist()))}
    scores = {name: SegmentationScore.of(rows.take(which)) for name, which in groups.items()}
    return {name: score for name, score in scores.items() if score.objects or score.cut}
