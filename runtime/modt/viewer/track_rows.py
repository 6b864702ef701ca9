"""The tracks of a run as one table of integers: a row a track and frame, sorted by track."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES
from modt.geometry import wrap, yaw_of
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt.types import NONE, Float64, FrameResult, Int

PLAIN = ("id", "at", "state", "class", "seen", "final", "classified", "points")
P = tuple(f"p_{name}" for name in CLASS_NAMES)
WORLD = tuple(f"world_{key}" for key in WORLD_KEYS)
SCALED = (*P, *BOX_KEYS, *WORLD)
COLUMNS = (*PLAIN, *SCALED)
"""`at` is the index of the frame in the run, `seen` whether it has a proposal; probabilities are per mille, lengths
[cm], angles [mrad], speeds [cm/s]. The box of a track that is lost is its last one, where the filter has it now."""
_ANGLES = {"yaw", "world_heading"}
SCALE = {name: 1000 if name in P or name in _ANGLES else 100 for name in SCALED}


def frame_rows(at: int, record: dict[str, Any], states: list[str]) -> list[list[float]]:
    """Rows of a line of tracks.jsonl in units of the line; names of states are added to `states`."""
    classified, rows = set(record.get("classified", ())), []
    for track in record["tracks"]:
        state = str(track["state"])
        if state not in states:
            states.append(state)
        box = track["box"] or dict.fromkeys(BOX_KEYS, 0.0)
        rows.append(
            [
                track["id"],
                at,
                states.index(state),
                CLASS_NAMES.index(track["class"]),
                track["box"] is not None,
                track["final"],
                track["id"] in classified,
                track["points"],
                *track["posterior"],
                *(box[key] for key in BOX_KEYS),
                *(track["world"][key] for key in WORLD_KEYS),
            ]
        )
    return rows


def planar(T_world_sensor: Float64) -> Float64:
    """(3,) x, y [m], yaw [rad] of a pose."""
    return np.array([*T_world_sensor[:2, 3], yaw_of(T_world_sensor)])


def track_table(frames: Iterable[Sequence[Sequence[float]]], poses: Float64) -> Int:
    """(R, COLUMNS) table of the rows of F frames, and of (F, 3) planar poses of the sensor."""
    parts = [np.array(rows, np.float64).reshape(-1, len(COLUMNS)) for rows in frames]
    rows = np.concatenate(parts) if parts else np.zeros((0, len(COLUMNS)))
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    _fill_lost(rows, poses)
    return scaled(rows)


def scaled(rows: Float64) -> Int:
    """Rows in the units of the table."""
    rows[:, len(PLAIN) :] *= [SCALE[name] for name in SCALED]
    return np.rint(rows).astype(np.int64)


def result_rows(result: FrameResult) -> Float64:
    """(M, COLUMNS) rows of the tracks of a result, at frame 0."""
    tracks, pose = result.tracks, planar(result.T_world_sensor)
    seen = tracks.proposal != NONE
    box = tracks.box.copy()
    c, s = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = (tracks.x[:, :2] - pose[:2]).T
    box[:, 0], box[:, 1], box[:, 6] = c * dx + s * dy, c * dy - s * dx, wrap(box[:, 6] - pose[2])
    box[seen] = result.proposals.box[tracks.proposal[seen]]
    plain = (
        tracks.id,
        np.zeros(len(tracks)),
        tracks.state,
        tracks.object_class,
        seen,
        tracks.final,
        np.isin(tracks.id, result.classified),
        tracks.points,
    )
    return np.column_stack([*plain, tracks.posterior, box, tracks.x]).astype(np.float64)


def _fill_lost(rows: Float64, poses: Float64) -> None:
    """Write the boxes of the lost tracks: their last ones, where the filter has them now."""
    seen, x, yaw, world = (COLUMNS.index(name) for name in ("seen", "x", "yaw", "world_x"))
    index = np.arange(len(rows))
    first = np.append(True, np.diff(rows[:, 0]) != 0)[: len(rows)]
    last = np.maximum.accumulate(np.where(first | (rows[:, seen] > 0), index, 0))
    lost = np.flatnonzero(rows[:, seen] == 0)
    pose, then = poses[rows[lost, 1].astype(int)], poses[rows[last[lost], 1].astype(int)]
    rows[lost, x : yaw + 1] = rows[last[lost], x : yaw + 1]
    dx, dy = (rows[lost, world : world + 2] - pose[:, :2]).T
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    rows[lost, x], rows[lost, x + 1] = c * dx + s * dy, c * dy - s * dx
    rows[lost, yaw] = wrap(rows[lost, yaw] + then[:, 2] - pose[:, 2])
