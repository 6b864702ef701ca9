"""The judgement of runs: every figure, from the judged rows of each frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from modt.classes import CLASS_NAMES
from modt.types import NONE
from modt_evaluation.box_score import BoxScore, box_scores
from modt_evaluation.class_score import ClassScore, class_scores, top_calibration_error
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.matching import judge
from modt_evaluation.reaction import Reaction, reactions
from modt_evaluation.rows import Association, Outcome, Rows, kinds, ratio
from modt_evaluation.rules import Rules
from modt_evaluation.track_score import TrackScore, track_metrics, track_scores
from modt_evaluation.truth import LABELLED, Role


@dataclass(frozen=True)
class SegmentationScore:
    """Counts of one kind of object, one for each object and frame; merged to missed in the order of `Outcome`."""

    objects: int  # judged
    recall: float | None  # share of them that is detected
    merged: int
    split: int
    partial: int
    missed: int
    cut: int  # objects mostly out of view, judged or not


def segmentation(objects: Rows) -> dict[str, SegmentationScore]:
    """The score of each class and of each labelled type."""
    scores = {}
    for name, which in kinds(objects).items():
        judged = objects["outcome"][which & objects["to_segment"]]
        detected, merged, split, partial, missed = np.bincount(judged, minlength=len(Outcome)).tolist()
        cut = int((which & ~objects["in_view"] & np.isin(objects["role"], LABELLED)).sum())
        if len(judged) or cut:
            recall = ratio(detected, len(judged))
            scores[name] = SegmentationScore(len(judged), recall, merged, split, partial, missed, cut)
    return scores


SCHEMA = "modt.evaluation/1"
ALL = "all"
RANGES_M = {ALL: (0.0, float("inf")), "0-20": (0.0, 20.0), "20-40": (20.0, 40.0), "40-60": (40.0, 60.0)}
"""Bands of range by name."""


@dataclass(frozen=True)
class DriveRows:
    """Judged rows of one drive: tables of its objects, proposals and reported objects, and associations by class."""

    rules: Rules
    frames: int
    n_proposals: int
    classified: int
    objects: Rows
    proposals: Rows
    reported: Rows
    associations: tuple[tuple[Association, ...], ...]


@dataclass(frozen=True)
class RangeScore:
    """Scores of what lies within a band of range, by class (segmentation: by labelled type, too)."""

    segmentation: dict[str, SegmentationScore]
    classification: dict[str, ClassScore]


@dataclass(frozen=True)
class Evaluation:
    """Scores of some drives; tracks and metrics are empty and None where labels have no identities."""

    drives: int
    sectors_deg: tuple[float, ...]  # half angles of the judged sectors, without repeats, ascending
    complete: bool  # whether the labels of all drives are taken for complete
    further_objects: int  # objects added beside the labels
    further_labels: int  # labels of these objects, one a frame
    frames: int
    proposals: int
    beta: float | None  # proposals classified over all
    ranges: dict[str, RangeScore]  # scores by band of range
    tracks: dict[str, TrackScore]  # scores of all objects, by class and by labelled type
    metrics: dict[str, dict[str, float]] | None  # metrics of all classes and of each; None without trackeval
    boxes: dict[str, BoxScore]  # scores of boxes and velocities, by class
    reaction: dict[str, Reaction]  # frames until objects are reported, by class
    calibration_error: float | None  # expected, of the most probable class, over all judged proposals
    calibration_error_of_objects: float | None  # the same over the proposals that stand for an object


def collect(frames: Iterable[JudgedFrame], rules: Rules, drive: int = 0) -> DriveRows:
    """Judge the frames of a drive. Pooled drives need different numbers.

    Raises:
        ValueError: there are no frames.
    """
    judged = []
    n_proposals = 0
    classified = 0
    for frame in frames:
        judged.append(judge(frame, rules, drive))
        n_proposals += frame.n_proposals
        classified += frame.classified
    if not judged:
        raise ValueError("no frames")
    objects, proposals, associations, reported = zip(*judged, strict=True)
    by_class = tuple(zip(*associations, strict=True))
    rows = np.concatenate(objects), np.concatenate(proposals), np.concatenate(reported)
    return DriveRows(rules, len(judged), n_proposals, classified, *rows, by_class)


def evaluation(drives: Sequence[DriveRows]) -> Evaluation:
    """Every figure over all drives together."""
    objects = np.concatenate([drive.objects for drive in drives])
    proposals = np.concatenate([drive.proposals for drive in drives])
    n_proposals = sum(drive.n_proposals for drive in drives)
    judged = proposals[proposals["to_classify"]]
    further = objects[objects["role"] == Role.FURTHER]
    on_objects = judged[judged["label"] > 0]
    return Evaluation(
        drives=len(drives),
        sectors_deg=tuple(sorted({drive.rules.sector_deg for drive in drives})),
        complete=all(drive.rules.complete for drive in drives),
        further_objects=len(set(further[["drive", "id"]].tolist())),
        further_labels=len(further),
        frames=sum(drive.frames for drive in drives),
        proposals=n_proposals,
        beta=ratio(sum(drive.classified for drive in drives), n_proposals),
        ranges={name: _in_range(objects, proposals, *band) for name, band in RANGES_M.items()},
        tracks=track_scores(objects, proposals),
        metrics=_metrics(drives) if (objects["id"] != NONE).any() else None,
        boxes=box_scores(objects, np.concatenate([drive.reported for drive in drives])),
        reaction=reactions(objects),
        calibration_error=top_calibration_error(judged["posterior"], judged["label"]),
        calibration_error_of_objects=top_calibration_error(on_objects["posterior"], on_objects["label"]),
    )


def _in_range(objects: Rows, proposals: Rows, low_m: float, high_m: float) -> RangeScore:
    """The scores of the objects and proposals in one band of range."""
    objects, proposals = (t[(t["range_m"] >= low_m) & (t["range_m"] < high_m)] for t in (objects, proposals))
    return RangeScore(segmentation(objects), class_scores(objects, proposals))


def _metrics(drives: Sequence[DriveRows]) -> dict[str, dict[str, float]] | None:
    """HOTA, CLEAR and Identity of all classes and of each; None without trackeval."""
    if find_spec("trackeval") is None:
        return None
    groups = {ALL: [frames for drive in drives for frames in drive.associations]}
    groups |= {name: [drive.associations[k] for drive in drives] for k, name in enumerate(CLASS_NAMES[1:])}
    return {name: found for name, sequences in groups.items() if (found := track_metrics(sequences))}
