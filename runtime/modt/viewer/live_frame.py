"""Message of a result for the live page."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.sinks.records import line
from modt.types import FrameResult
from modt.viewer import theme
from modt.viewer.packed import packed_cells, packed_table
from modt.viewer.point_cells import LEVEL_M, LEVELS, SIDE, Cells, occupied
from modt.viewer.track_rows import planar, result_rows, scaled

STEP_CM = 5
MOST_CELLS = 50_000
FASTEST = 1
"""Level of the fastest compression."""


def live_message(result: FrameResult, costs: dict[str, Any]) -> str:
    """Line of JSON for a frame."""
    frame = {
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 3),
        "proposals": len(result.proposals),
        "classifications": len(result.classified),
        "deferred": result.n_deferred,
        "pose": planar(result.T_world_sensor).round(4).tolist(),
        **costs,
    }
    content = {
        "frame": frame,
        "states": theme.states(result.state_names),
        "tracks": packed_table(scaled(result_rows(result)), FASTEST),
        "points": packed_cells(live_cells(result).thinned(MOST_CELLS), FASTEST),
    }
    return line(content)


def live_cells(result: FrameResult) -> Cells:
    """Cells of the sweep; points without a proposal count as ground."""
    x, y, z = (result.frame.points[:, k] for k in range(3))
    reach_m = (SIDE // 2 - 1) * STEP_CM / 100
    used = (np.abs(x) < reach_m) & (np.abs(y) < reach_m) & ((x != 0) | (y != 0))
    level = np.zeros(len(x), np.int64)
    members = result.proposals.members
    ground = used.copy()
    ground[members] = False
    floor_m = float(np.median(z[ground])) if ground.any() else 0.0
    level[members] = np.clip(np.rint((z[members] - floor_m) / LEVEL_M), 1, LEVELS - 1)
    return occupied(x[used], y[used], level[used], STEP_CM)
