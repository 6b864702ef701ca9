"""The recorded tracks of a run as one table of `modt.viewer.track_rows`, sorted by track, and their extent."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from modt.types import NONE, Float64, FrameResult, Int
from modt.viewer.theme import REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE, result_rows, scaled


def frame_rows(at: int, result: FrameResult, states: list[str], boxes: dict[int, Float64]) -> Float64:
    """(M, COLUMNS) rows of a recorded result.

    Args:
        at: index of the frame.
        result: recorded result, whose lost tracks get their last boxes.
        states: names of the states so far; those of the result are added.
        boxes: last box of each track in the world so far, by its id; those of the result are added.
    """
    states += [name for name in result.state_names if name not in states]
    number, tracks = np.array([states.index(name) for name in result.state_names], np.int64), result.tracks
    for id_, lost, box in zip(tracks.id.tolist(), (tracks.proposal == NONE).tolist(), tracks.box, strict=True):
        box[:] = boxes.get(id_, box) if lost else box
        boxes[id_] = box
    rows = result_rows(result)
    rows[:, COLUMNS.index("at")], rows[:, COLUMNS.index("state")] = at, number[tracks.state]
    return rows


def track_table(frames: Iterable[Float64]) -> Int:
    """(R, COLUMNS) table of the rows of the frames."""
    rows = np.concatenate([np.zeros((0, len(COLUMNS))), *frames])
    return scaled(rows[np.lexsort((rows[:, 1], rows[:, 0]))])


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
