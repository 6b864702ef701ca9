"""The recorded tracks of a run as one table of `modt.viewer.track_rows`, sorted by track."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES
from modt.geometry import wrap
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt.types import Float64, Int
from modt.viewer.track_rows import COLUMNS, scaled


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
                *track.get("witness", [0.0] * len(CLASS_NAMES)),  # earlier runs have none
                *(box[key] for key in BOX_KEYS),
                *(track["world"][key] for key in WORLD_KEYS),
            ]
        )
    return rows


def track_table(frames: Iterable[Sequence[Sequence[float]]], poses: Float64) -> Int:
    """(R, COLUMNS) table of the rows of F frames, and of (F, 3) planar poses of the sensor."""
    parts = [np.array(rows, np.float64).reshape(-1, len(COLUMNS)) for rows in frames]
    rows = np.concatenate(parts) if parts else np.zeros((0, len(COLUMNS)))
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    _fill_lost(rows, poses)
    return scaled(rows)


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
