"""The points of a sweep for a picture from above: the cells of a square grid, each with its highest point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.segmentation.grids import PointColumns
from modt.segmentation.segmenter import Segmenter
from modt.types import Float32, Int

SIDE = 4096
"""Cells of the grid along x and along y: three bytes count them all."""
STEP_CM = 4
"""Least width of a cell."""
LEVEL_M = 0.1
LEVELS = 64
"""Heights above ground are whole multiples of LEVEL_M below LEVELS; level 0 is ground."""


@dataclass(frozen=True, slots=True)
class Cells:
    """The occupied cells of a sweep, by their number."""

    cell: Int  # (n,) SIDE * row + column, ascending; column and row count from -x and -y, the sensor at SIDE / 2
    level: Int  # (n,) height above ground [LEVEL_M], 0 for ground

    def __len__(self) -> int:
        return len(self.cell)

    def thinned(self, most: int) -> Cells:
        """At most so many of them, of the ground as few as need be."""
        kept = [np.flatnonzero(self.level > 0), np.flatnonzero(self.level == 0)]
        for group, rows in enumerate(kept):
            room = max(most - (len(kept[0]) if group else 0), 0)
            if len(rows) > room:
                kept[group] = rows[np.linspace(0, len(rows), room, endpoint=False).astype(np.int64)]
        rows = np.sort(np.concatenate(kept))
        return Cells(self.cell[rows], self.level[rows])


class Grid:
    """Sweeps to cells, in which the segmenter of a profile says what is ground."""

    def __init__(self, config: ProfileConfig) -> None:
        self._segmenter = Segmenter(config.segmentation, config.sensor, FieldOfView())
        self._clearance_m = config.segmentation.clearance_m
        self._range_m = config.sensor.max_range_m
        self.step_cm = max(STEP_CM, math.ceil(200 * self._range_m / SIDE))

    def cells(self, points: Float32) -> Cells:
        """Cells of (N, 4) points; those beyond the range of the sensor count as none."""
        sweep = PointColumns.from_array(points)
        height = self._segmenter.ground.height_above(sweep, self._segmenter.sensor_height_m(points))
        sweep_range = sweep.sqrt_range**2
        used = (sweep_range > 0) & (sweep_range < self._range_m)
        level = np.clip(np.rint(height[used] / LEVEL_M), 1, LEVELS - 1).astype(np.int64)
        level[height[used] <= self._clearance_m] = 0
        return occupied(sweep.x[used], sweep.y[used], level, self.step_cm)


def occupied(x: Float32, y: Float32, level: Int, step_cm: int) -> Cells:
    """The cells of points x, y [m] within the grid, each with the highest level of its points."""
    column, row = (np.floor(v * (100 / step_cm)).astype(np.int64) + SIDE // 2 for v in (x, y))
    # Sorted by cell, then by height: the last of each cell is its highest.
    packed = np.sort((SIDE * row + column) * LEVELS + level)
    cell, level = np.divmod(packed, LEVELS)
    highest = np.append(np.diff(cell) > 0, True)[: len(cell)]
    return Cells(cell[highest], level[highest])
