"""How high the sensor stands above the ground."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.columns import Columns
from modt.segmentation.grids import RING_STEP, SECTORS, PolarGrid
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
FLAT_M, SLOPE = 0.1, 0.2
"""The returns of a cell of ground lie within this of one another in height, more by this share of its width."""
GRAZING_BEAMS = 2.0
"""Whatever the beams just below the horizon hit lies just below the sensor; ground is seen by lower ones."""


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
    """The height at which most of what lies flat around the sensor lies, settled over the first sweeps.

    Walls have lowest returns too, and between four of them they are most of what is seen: their cells are not flat.

    Args:
        sensor: its range and the spacing of its beams.
    """

    def __init__(self, sensor: SensorConfig) -> None:
        self.near, self.far = sensor.min_range_m, min(AROUND_M, sensor.max_range_m)
        self.grid = PolarGrid(self.far)
        range_m = np.repeat(self.grid.range_m, SECTORS).astype(np.float64)
        self.spread = FLAT_M + SLOPE * 2 * RING_STEP * np.sqrt(range_m)
        self.grazing = GRAZING_BEAMS * np.deg2rad(sensor.elevation_step_deg) * range_m
        self.seen: list[float] = []

    def of(self, points: Columns) -> float:
        """Median of the estimates of the first sweeps, this one's among them [m]."""
        if len(self.seen) < SWEEPS:
            estimate = self._estimate(points)
            if estimate is not None:
                self.seen.append(estimate)
        return float(np.median(self.seen)) if self.seen else USUAL_M

    def _estimate(self, points: Columns) -> float | None:
        around = points.take((points.root > np.sqrt(self.near)) & (points.root < np.sqrt(self.far)))
        cell = self.grid.cell(around)
        lowest: Float32 = np.full(self.grid.size, np.inf, np.float32)
        highest: Float32 = np.full(self.grid.size, -np.inf, np.float32)
        np.minimum.at(lowest, cell, around.z)
        np.maximum.at(highest, cell, around.z)
        flat = (highest - lowest < self.spread) & (-lowest > self.grazing)
        depth = -lowest[flat].astype(np.float64)
        cells = np.bincount((depth / BIN_M).astype(np.int64), minlength=1)
        alike = np.convolve(cells, np.ones(3, np.int64), mode="same")
        if alike.max() < MIN_CELLS:
            return None
        middle = (int(np.argmax(alike)) + 0.5) * BIN_M
        return float(depth[np.abs(depth - middle) < 1.5 * BIN_M].mean())


def sensor_height(sensor: SensorConfig) -> SensorHeight:
    """The height the configuration gives, or one that will be estimated."""
    return EstimatedHeight(sensor) if sensor.height_m is None else KnownHeight(sensor.height_m)
