"""The judgement of runs: every figure, from what became of each frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from modt.evaluation.class_score import ClassScore, class_scores, top_calibration_error
from modt.evaluation.frame import JudgedFrame
from modt.evaluation.matching import judge
from modt.evaluation.rows import Association, ObjectRows, ProposalRows
from modt.evaluation.rules import KITTI_RULES, Rules
from modt.evaluation.segmentation_score import SegmentationScore, segmentation
from modt.evaluation.track_score import TrackScore, track_metrics, track_scores
from modt.types import CLASS_NAMES, NONE

SCHEMA = "modt.evaluation/1"
ALL = "all"
RANGES = {ALL: (0.0, float("inf")), "0-20": (0.0, 20.0), "20-40": (20.0, 40.0), "40-60": (40.0, 60.0)}
"""Bands of range [m] by name."""


@dataclass(frozen=True, slots=True)
class DriveRows:
    """What became of the frames of one drive.

    Attributes:
        frames, proposals, classified: how many.
        objects, rows: the tables of labelled objects and of proposals.
        associations: by class, frame by frame.
    """

    frames: int
    proposals: int
    classified: int
    objects: ObjectRows
    rows: ProposalRows
    associations: tuple[tuple[Association, ...], ...]


@dataclass(frozen=True, slots=True)
class RangeScore:
    """Scores of what lies within a band of range, by class (segmentation: by labelled type, too)."""

    segmentation: dict[str, SegmentationScore]
    classification: dict[str, ClassScore]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """How good some drives came out.

    Attributes:
        drives, frames, proposals: judged.
        beta: proposals classified over all.
        ranges: scores by band of range.
        tracks: of all objects, by class and by labelled type; empty where labels have no identities.
        metrics: HOTA, DetA, AssA, MOTA, IDF1, id switches and fragmentations, of all classes and each; None where
            trackeval is not installed or labels have no identities.
        calibration_error: expected, of the most probable class, over all judged proposals.
        calibration_error_of_objects: over those that stand for an object.
    """

    drives: int
    frames: int
    proposals: int
    beta: float | None
    ranges: dict[str, RangeScore]
    tracks: dict[str, TrackScore]
    metrics: dict[str, dict[str, float]] | None
    calibration_error: float | None
    calibration_error_of_objects: float | None

    def json(self) -> dict[str, Any]:
        """As plain data."""
        return dataclasses.asdict(self)


def score(frames: Iterable[JudgedFrame], rules: Rules = KITTI_RULES, *, metrics: bool = True) -> Evaluation:
    """The evaluation of one drive.

    Args:
        frames: of the drive, in order.
        rules: what counts.
        metrics: compute HOTA, CLEAR and Identity, if trackeval is installed.

    Raises:
        ValueError: there are no frames.
    """
    return evaluation([collect(frames, rules)], metrics=metrics)


def collect(frames: Iterable[JudgedFrame], rules: Rules, drive: int = 0) -> DriveRows:
    """What became of a drive's frames; drives that are pooled need numbers of their own.

    Raises:
        ValueError: there are no frames.
    """
    judged, n, proposals, classified = [], 0, 0, 0
    for frame in frames:
        judged.append(judge(frame, rules, drive))
        n, proposals, classified = n + 1, proposals + frame.n_proposals, classified + frame.classified
    if not judged:
        raise ValueError("no frames")
    return DriveRows(
        frames=n,
        proposals=proposals,
        classified=classified,
        objects=ObjectRows.joined([j.objects for j in judged]),
        rows=ProposalRows.joined([j.proposals for j in judged]),
        associations=tuple(zip(*(j.associations for j in judged), strict=True)),
    )


def evaluation(evidence: Sequence[DriveRows], *, metrics: bool = True) -> Evaluation:
    """Every figure over all drives together."""
    objects = ObjectRows.joined([e.objects for e in evidence])
    rows = ProposalRows.joined([e.rows for e in evidence])
    proposals, judged = sum(e.proposals for e in evidence), rows.take(rows.to_classify)
    on_objects = judged.take(judged.label > 0)
    return Evaluation(
        drives=len(evidence),
        frames=sum(e.frames for e in evidence),
        proposals=proposals,
        beta=sum(e.classified for e in evidence) / proposals if proposals else None,
        ranges={name: _in_range(objects, rows, *band) for name, band in RANGES.items()},
        tracks=track_scores(objects, rows),
        metrics=_metrics(evidence) if metrics and (objects.id != NONE).any() else None,
        calibration_error=top_calibration_error(judged.posterior, judged.label),
        calibration_error_of_objects=top_calibration_error(on_objects.posterior, on_objects.label),
    )


def _in_range(objects: ObjectRows, rows: ProposalRows, low_m: float, high_m: float) -> RangeScore:
    seen = objects.take((objects.range_m >= low_m) & (objects.range_m < high_m))
    found = rows.take((rows.range_m >= low_m) & (rows.range_m < high_m))
    return RangeScore(segmentation(seen), class_scores(seen, found))


def _metrics(evidence: Sequence[DriveRows]) -> dict[str, dict[str, float]] | None:
    try:
        import trackeval  # noqa: F401
    except ImportError:
        return None
    by_class = {name: track_metrics([e.associations[k] for e in evidence]) for k, name in enumerate(CLASS_NAMES[1:])}
    everything = track_metrics([frames for e in evidence for frames in e.associations])
    return {name: found for name, found in {ALL: everything, **by_class}.items() if found}
