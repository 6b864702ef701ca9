"""Results restored from recorded frames, for the sinks."""

from __future__ import annotations

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
    same = {"id": tracks.id, "viewed": tracks.key_points, "final": tracks.final, "points": tracks.points}
    same |= {"age": tracks.age, "missed": tracks.missed}
    for key, column in same.items():
        column[:] = [row[key] for row in rows]
    tracks.state[:] = [names.index(row["state"]) for row in rows]
    tracks.object_class[:] = [CLASS_NAMES.index(row["class"]) for row in rows]
    tracks.posterior[:] = np.array([row["posterior"] for row in rows]).reshape(tracks.posterior.shape)
    silent = [0.0] * len(CLASS_NAMES)  # runs of earlier versions have no "witness"
    tracks.motion_evidence[:] = np.array([row.get("witness", silent) for row in rows]).reshape(
        tracks.motion_evidence.shape
    )
    tracks.size_m[:] = np.array([row.get("size", [0.0] * 3) for row in rows]).reshape(tracks.size_m.shape)
    tracks.motion[:] = [MOTION_NAMES.index(row.get("motion", "unknown")) for row in rows]
    tracks.moving_probability[:] = [row.get("moving", 0.5) for row in rows]
    tracks.velocity[:] = np.array([row.get("velocity", [0.0] * 2) for row in rows]).reshape(-1, 2)
    tracks.heading_known[:] = [row.get("heading_known", False) for row in rows]
    covariance = np.array([row.get("velocity_covariance", [0.0] * 3) for row in rows]).reshape(-1, 3)
    tracks.velocity_covariance[:] = covariance[:, [[0, 1], [1, 2]]]
    tracks.proposal[:] = [NONE if row["proposal"] is None else row["proposal"] for row in rows]
    if (tracks.proposal < NONE).any():
        raise ValueError("a track's proposal is none of the frame's")
    tracks.x[:] = _table([row["world"] for row in rows], WORLD_KEYS)
    seen = np.flatnonzero(tracks.proposal != NONE)
    whole = _table([row["box"] for row in rows if row["proposal"] is not None], BOX_KEYS)
    tracks.whole_box[seen] = transform_boxes(T_world_sensor, whole)
    boxes = _table([seen_box(row) for row in rows if row["proposal"] is not None], BOX_KEYS)
    tracks.box[seen] = transform_boxes(T_world_sensor, boxes)
    proposals = _proposals(int(record["proposals"]))
    proposals.box[tracks.proposal[seen]] = boxes
    frame = Frame(int(record["frame"]), float(record["stamp_s"]), NO_POINTS)
    classified = np.array(record.get("classified", []), np.int64)
    run_id = record.get("run") or ""
    return FrameResult(frame, T_world_sensor, proposals, tracks, names, int(record["deferred"]), classified, run_id)


def seen_box(row: dict[str, Any]) -> dict[str, float]:
    """What the frame shows of a track in view; in runs of earlier versions that is `box`."""
    seen: dict[str, float] = row.get("seen", row["box"])
    return seen


def _table(rows: list[dict[str, float]], keys: tuple[str, ...]) -> Float64:
    return np.array([[row[key] for key in keys] for row in rows], np.float64).reshape(-1, len(keys))


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
