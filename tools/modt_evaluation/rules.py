"""Rules of the evaluation (docs/evaluation.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace

IGNORABLE = ("cut", "few", "parked", "dontcare")
"""Objects cut by the view or of few points; proposals on parked cars outside their labels or in DontCare regions."""


@dataclass(frozen=True)
class Rules:
    """Thresholds of a judgement.

    For average precision, an object and a proposal are a pair if the IoU of their points exceeds one half (`by_iou`),
    otherwise if each holds more than half of the other.
    """

    min_points: int = 20  # least points of an object that must be segmented
    min_points_followed: int = 10  # least points of an object that must be followed, or counts for average precision
    min_points_further: int = 8  # least points of an object beside the labels
    by_iou: bool = False
    sector_deg: float = 40.0  # half the sector about x in which proposals are judged: where everything is labelled
    max_range_m: float = float("inf")  # farthest judged object or proposal
    ignored: frozenset[str] = frozenset(IGNORABLE)  # kinds that are ignored
    complete: bool = False  # whether labels are taken for complete in the sector


KITTI_RULES = Rules()
"""Labels cover what the left colour camera sees, and leave out road users."""
KITTI_ALL_ROUND_RULES = replace(KITTI_RULES, sector_deg=180.0, complete=True)
"""Labels in KITTI's layout that cover the full circle."""
CUBOID_RULES = Rules(
    min_points_followed=20, min_points_further=20, by_iou=True, sector_deg=180.0, max_range_m=60.0, complete=True
)
"""Tables of cuboids, which cover the full circle."""
