"""The recorded tracks of a run as one table of `modt.viewer.track_rows`, sorted by track, and their extent."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from modt.geometry import wrap
from modt.types import Float64, FrameResult, Int
from modt.viewer.theme import REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE, result_rows, scaled


def frame_rows(at: int, result: FrameResult, states: list[str]) -> Float64:
    """(M, COLUMNS) rows of a recorded result; names of states are added to `states`."""
    states += [name for name in result.state_names if name not in states]
    number = np.array([states.index(name) for name in result.state_names], np.int64)
    rows = result_rows(result)
    rows[:, COLUMNS.index("at")], rows[:, COLUMNS.index("state")] = at, number[result.tracks.state]
    return rows


def track_table(frames: Iterable[Float64], poses: Float64) -> Int:
    """(R, COLUMNS) table of the rows of F frames, and of (F, 3) planar poses of the sensor."""
    rows = np.concatenate([np.zeros((0, len(COLUMNS))), *frames])
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


_SIDE_M = 32.0
"""Half the height of a picture whose half width is REACH_M."""
RINGS_M = {6.0: 2, 10.0: 5, 15.0: 5, 20.0: 10, 30.0: 10, REACH_M: 20}
"""Ranges that a picture may reach, and the distance of the rings in it."""
_NEARLY = 0.95
"""Share of the tracked boxes that must be visible."""


def reach_m(tracks: Int) -> float:
    """Half the width of a picture that shows nearly all of (R, COLUMNS) rows of tracks; REACH_M at most."""
    seen = tracks[tracks[:, COLUMNS.index("seen")] > 0]
    if not len(seen):
        return REACH_M
    x, y = (np.abs(seen[:, COLUMNS.index(name)]) / SCALE[name] for name in ("x", "y"))
    needed = np.quantile(np.maximum(x, y * REACH_M / _SIDE_M), _NEARLY)
    return next((reach for reach in RINGS_M if reach >= needed), REACH_M)
