"""Results restored from recorded frames, for the sinks."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.classes import CLASS_NAMES, CLASSES
from modt.geometry import transform_boxes
from modt.sinks.kitti import MAX_INSTANCE
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt.types import MOTION_NAMES, NONE, Float32, Float64, Frame, FrameResult, Int, Proposals, Tracks

MOST_PROPOSALS = 100_000
"""Most proposals of a valid record; sweeps have some hundreds."""
SEMANTIC = np.array([(*spec.semantic_kitti, 0)[0] for spec in CLASSES])
"""SemanticKITTI's label of each class, 0 (unlabelled) for the background."""
NO_POINTS: Float32 = np.zeros((0, 4), np.float32)


def _symmetric(row: dict[str, Any]) -> list[list[float]]:
    xx, xy, yy = row["velocity_covariance"]
    return [[xx, xy], [xy, yy]]


_COLUMNS: dict[str, Callable[[dict[str, Any]], Any]] = {
    **{name: itemgetter(name) for name in ("id", "final", "points", "age", "missed", "posterior", "velocity")},
    "key_points": itemgetter("viewed"),
    "object_class": lambda row: CLASS_NAMES.index(row["class"]),
    "motion_evidence": itemgetter("witness"),
    "size_m": itemgetter("size"),
    "motion": lambda row: MOTION_NAMES.index(row["motion"]),
    "moving_probability": itemgetter("moving"),
    "velocity_covariance": _symmetric,
    "heading_known": itemgetter("heading_known"),
    "proposal": lambda row: NONE if row["proposal"] is None else row["proposal"],
    "x": lambda row: [row["world"][key] for key in WORLD_KEYS],
}
"""Entry of each column that a recorded track has."""


@np.errstate(over="raise", invalid="raise")
def recorded_result(record: dict[str, Any]) -> FrameResult:
    """The result that a line of tracks.jsonl records.

    Proposals have their boxes, no members, and none counts as truncated. Points, covariances, the views of the fusion
    and the boxes of lost tracks stay blank.

    Raises:
        one of modt.sinks.records.BROKEN: the record lacks something.
    """
    rows = record["tracks"]
    T_world_sensor = recorded_pose(record)
    names = tuple(sorted({row["state"] for row in rows}))
    tracks = Tracks.blank(len(rows))
    tracks.state[:] = [names.index(row["state"]) for row in rows]
    for name, entry in _COLUMNS.items():
        column = getattr(tracks, name)
        entries = np.array([entry(row) for row in rows])
        column[:] = entries if column.ndim == 1 else entries.reshape(column.shape)
    if (tracks.proposal < NONE).any():
        raise ValueError("a track's proposal is none of the frame's")
    seen = np.flatnonzero(tracks.proposal != NONE)
    in_view = [row for row in rows if row["proposal"] is not None]
    whole = _boxes([row["box"] for row in in_view])
    tracks.whole_box[seen] = transform_boxes(T_world_sensor, whole)
    boxes = _boxes([row["seen"] for row in in_view])
    tracks.box[seen] = transform_boxes(T_world_sensor, boxes)
    proposals = _proposals(int(record["proposals"]))
    proposals.box[tracks.proposal[seen]] = boxes
    frame = Frame(int(record["frame"]), float(record["stamp_s"]), NO_POINTS)
    classified = np.array(record["classified"], np.int64)
    run_id = record["run"] or ""
    return FrameResult(frame, T_world_sensor, proposals, tracks, names, int(record["deferred"]), classified, run_id)


def _boxes(rows: list[dict[str, float]]) -> Float64:
    """(R, 7) recorded boxes."""
    return np.array([[row[key] for key in BOX_KEYS] for row in rows], np.float64).reshape(-1, len(BOX_KEYS))


def _proposals(n: int) -> Proposals:
    """N proposals without points.

    Raises:
        ValueError: these are too many.
    """
    if n > MOST_PROPOSALS:
        raise ValueError(f"{n} proposals")
    none = np.zeros(0, np.int64)
    offsets = np.zeros(n + 1, np.int64)
    coordinates = np.zeros((3, 0), np.float32)
    return Proposals(none, offsets, coordinates, np.zeros((n, 3)), np.zeros((n, 7)), np.zeros(n, np.int64))


def semantic_labels(tracks: Tracks, proposals: Int) -> NDArray[np.uint32]:
    """(N,) SemanticKITTI's label of each point by the track of its proposal (N,), NONE where it belongs to none.

    Upper 16 bits: the track's id modulo 65535, plus one. Lower 16 bits: SemanticKITTI's label of its class. Points of
    the background are 0.
    """
    code = np.zeros(max(proposals.max(initial=NONE), tracks.proposal.max(initial=NONE)) + 2, np.uint32)
    seen = np.flatnonzero(tracks.proposal != NONE)
    label = SEMANTIC[tracks.object_class[seen]]
    instance = tracks.id[seen] % MAX_INSTANCE + 1
    code[tracks.proposal[seen]] = np.where(label > 0, instance << 16 | label, 0)
    return code[proposals]  # index -1, NONE, is the last one


def recorded_pose(record: dict[str, Any]) -> Float64:
    """(4, 4) T_world_sensor of a record.

    Raises:
        one of modt.sinks.records.BROKEN: the record has none.
    """
    T = np.eye(4)
    T[:3] = np.reshape(record["T_world_sensor"], (3, 4))
    if not np.isfinite(T).all():
        raise ValueError("T_world_sensor is not finite")
    return T
