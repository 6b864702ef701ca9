"""The points beside the frames of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.segmentation.grids import PointColumns
from modt.segmentation.segmenter import Segmenter
from modt.sources.stream import Stream
from modt.types import Float32
from modt.viewer.point_cells import LEVEL_M, LEVELS, SIDE, Cells, occupied
from modt_desk.evaluation.run_record import FramesByNumber

NO_CELLS = Cells(np.zeros(0, np.int64), np.zeros(0, np.int64))


STEP_CM = 4
"""Least width of a cell [cm]."""


class Grid:
    """Converts sweeps to cells; the segmenter of a profile finds the ground."""

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


def sweeps(numbers: Sequence[int], stream: Stream, grid: Grid, most: int) -> Iterator[Cells]:
    """Cells of each frame, by ascending number, at most so many; none if the stream does not hold the frame."""
    frames = FramesByNumber(stream.between(0, numbers[-1] + 1))
    for number in numbers:
        frame = frames.get(number)
        yield NO_CELLS if frame is None else grid.cells(frame.points).thinned(most)
