"""How high the sensor stands above the ground."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.columns import Columns
from modt.segmentation.grids import PolarGrid
from modt.types import Float32

USUAL_M = 1.73
"""Taken where no ground has been seen yet."""
SWEEPS = 5
"""The first sweeps, over which an estimate settles."""
AROUND_M = 15.0
"""The ground is looked for within this range."""
BIN_M = 0.05
MIN_CELLS = 12
"""Fewer cells than this at one height are no ground."""


class SensorHeight(Protocol):
    """Knows the height of the sensor, or finds it out."""

    def of(self, points: Columns) -> float:
        """Height above the ground in a sweep [m]."""
        ...


class KnownHeight:
    """A height that was measured."""

    def __init__(self, height_m: float) -> None:
        self.height_m = height_m

    def of(self, points: Columns) -> float:
        """The height given [m]."""
        return self.height_m


class EstimatedHeight:
    """The height at which most of what lies lowest around the sensor lies, settled over the first sweeps.

    Args:
        sensor: its range.
    """

    def __init__(self, sensor: SensorConfig) -> None:
        self.near, self.far = sensor.min_range_m, min(AROUND_M, sensor.max_range_m)
        self.grid = PolarGrid(self.far)
        self.seen: list[float] = []

    def of(self, points: Columns) -> float:
        """Median of the estimates of the first sweeps, this one's among them [m]."""
        if len(self.seen) < SWEEPS:
            estimate = self._estimate(points)
            if estimate is not None:
                self.seen.append(estimate)
        return float(np.median(self.seen)) if self.seen else USUAL_M

    def _estimate(self, points: Columns) -> float | None:
        around = points.take((points.root > np.sqrt(self.near)) & (points.root < np.sqrt(self.far)) & (points.z < 0))
        lowest: Float32 = np.full(self.grid.size, np.inf, np.float32)
        np.minimum.at(lowest, self.grid.cell(around), around.z)
        depth = -lowest[np.isfinite(lowest)].astype(np.float64)
        cells = np.bincount((depth / BIN_M).astype(np.int64), minlength=1)
        level = np.convolve(cells, np.ones(3, np.int64), mode="same")
        if level.max() < MIN_CELLS:
            return None
        middle = (int(np.argmax(level)) + 0.5) * BIN_M
        return float(depth[np.abs(depth - middle) < 1.5 * BIN_M].mean())


def sensor_height(sensor: SensorConfig) -> SensorHeight:
    """The height the configuration gives, or one that will be estimated."""
    return EstimatedHeight(sensor) if sensor.height_m is None else KnownHeight(sensor.height_m)
