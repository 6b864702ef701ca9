"""Ground as piece-wise planes (section III-A): one height a polar cell, followed outwards ray by ray."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.columns import Columns
from modt.types import Float32, Int

SECTORS = 128
RING_STEP = 0.15
"""Rings lie this far apart in the square root of range [sqrt(m)]: 0.9 m at 10 m, 1.9 m at 40 m."""
NOISE_M = 0.1
"""Lowest returns of neighbouring cells on one plane differ by less."""
BEND = float(np.tan(np.deg2rad(4.0)))
"""The slope may change by this from one supported cell to the next."""
GAIN = 0.2
"""Share of a new slope that enters the running one."""
BRIDGE_M = 6.0
"""Gaps beyond this widen the search no more."""


class PolarGrid:
    """Cells around the sensor: rings that widen with range, sectors of a pseudo-angle that needs no arctangent.

    Args:
        max_range_m: how far the rings reach.
    """

    def __init__(self, max_range_m: float) -> None:
        self.rings = int(np.sqrt(max_range_m) / RING_STEP) + 2
        edge = (np.arange(self.rings + 1) * RING_STEP) ** 2
        self.range_m: Float32 = ((edge[1:] + edge[:-1]) / 2).astype(np.float32)

    def cell(self, points: Columns) -> Int:
        """(N,) cell of each point, ring by ring; points beyond the last ring belong to it."""
        ring = (points.root * np.float32(1 / RING_STEP)).astype(np.int32)
        np.minimum(ring, self.rings - 1, out=ring)
        taxicab = np.abs(points.x) + np.abs(points.y)
        turn = points.y / np.maximum(taxicab, np.float32(1e-6))
        turn = np.where(points.x < 0, np.float32(3.0) - turn, turn + np.float32(1.0))
        sector = (turn * np.float32(SECTORS / 4)).astype(np.int32)
        sector &= SECTORS - 1
        ring *= SECTORS
        ring += sector
        return ring.astype(np.int64)


class Ground:
    """Finds how high each point stands above the ground beneath it.

    The lowest return of a cell stands for its ground if it continues the ray's ground so far within a bound on
    the change of slope. That leaves out what stands on the ground, and reflections from below it; cells without
    ground take it from the line between their neighbours on the ray.

    Args:
        sensor: its range.
        config: steepest slope.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        self.grid = PolarGrid(sensor.max_range_m)
        self.near = float(np.sqrt(sensor.min_range_m))
        self.max_slope = float(np.tan(np.deg2rad(config.max_slope_deg)))

    def height(self, points: Columns, sensor_height_m: float) -> Float32:
        """(N,) height of each point above the ground [m]."""
        cell = self.grid.cell(points)
        lowest = self._lowest(points, cell, sensor_height_m)
        surface = _across(_along(*self._follow(lowest, sensor_height_m), self.grid.range_m))
        height: Float32 = points.z - surface.ravel()[cell]
        return height

    def _lowest(self, points: Columns, cell: Int, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) lowest return of each cell that could be ground, infinite where there is none."""
        depth = points.z + np.float32(sensor_height_m)
        reach = points.root * points.root * np.float32(self.max_slope) + np.float32(0.3)
        plausible = (np.abs(depth) < reach) & (points.root > np.float32(self.near))
        lowest = np.full(self.grid.rings * SECTORS, np.inf, np.float32)
        np.minimum.at(lowest, cell[plausible], points.z[plausible])
        return lowest.reshape(-1, SECTORS)

    def _follow(self, lowest: Float32, sensor_height_m: float) -> tuple[Float32, Float32]:
        """Ground of each supported cell, NaN elsewhere, and where each ray starts: a short step a ring."""
        range_m = self.grid.range_m
        start = np.full(SECTORS, -sensor_height_m, np.float32)
        ground = np.full_like(lowest, np.nan)
        height, at, slope = start.copy(), np.zeros(SECTORS, np.float32), np.zeros(SECTORS, np.float32)
        steepest = np.float32(self.max_slope)
        bend = np.full(SECTORS, steepest)
        for ring in np.flatnonzero(np.isfinite(lowest).any(axis=1)):
            gap = range_m[ring] - at
            reach = np.minimum(gap, np.float32(BRIDGE_M))
            rise = lowest[ring] - height
            found = np.abs(rise - slope * reach) < reach * bend + np.float32(NOISE_M)
            tilt = slope + np.float32(GAIN) * (rise / gap - slope)
            np.copyto(ground[ring], lowest[ring], where=found)
            np.copyto(height, lowest[ring], where=found)
            np.copyto(slope, np.minimum(np.maximum(tilt, -steepest), steepest), where=found)
            np.copyto(at, range_m[ring], where=found)
            np.copyto(bend, np.float32(BEND), where=found)
        return ground, start


def _along(ground: Float32, start: Float32, range_m: Float32) -> Float32:
    """The surface with its gaps filled by straight lines along each ray, level beyond the last support."""
    rings, sectors = ground.shape
    supported = ~np.isnan(ground)
    ground = np.where(supported, ground, start)
    supported[0] = True
    ring = np.arange(rings)[:, None]
    before = np.maximum.accumulate(np.where(supported, ring, 0), axis=0)
    after = np.minimum.accumulate(np.where(supported, ring, rings)[::-1], axis=0)[::-1]
    after = np.where(after == rings, before, after)
    ray = np.arange(sectors)
    low, high = ground[before, ray], ground[after, ray]
    span = np.maximum(range_m[after] - range_m[before], np.float32(1e-3))
    line: Float32 = low + (high - low) * ((range_m[:, None] - range_m[before]) / span)
    return line


def _across(surface: Float32) -> Float32:
    """The surface with each cell the median of itself and its two neighbours on the ring."""
    left, right = np.roll(surface, 1, axis=1), np.roll(surface, -1, axis=1)
    low, high = np.minimum(left, surface), np.maximum(left, surface)
    median: Float32 = np.maximum(low, np.minimum(high, right))
    return median
