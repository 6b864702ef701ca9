"""Ground as piece-wise planes (section III-A): one height a polar cell, followed outwards ray by ray."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.columns import Columns
from modt.segmentation.grids import SECTORS, PolarGrid
from modt.types import Bool, Float32, Int

NOISE_M = 0.1
"""Lowest returns of neighbouring cells on one plane differ by less."""
BEND = float(np.tan(np.deg2rad(4.0)))
"""The slope may change by this from one supported cell to the next."""
GAIN = 0.2
"""Share of a new slope that enters the running one."""
START_M = 0.3
"""The ground beneath the sensor may lie this far from where it should."""
BRIDGE_M = 6.0
"""Gaps beyond this widen the search no more."""
ONWARD = 0.7
"""Beyond the last ground that a ray meets, the ground goes on at this share of the ray's slope ..."""
ONWARD_M = 30.0
"""... for so long, and level from there."""
AROUND = 3
"""Sectors between a ray and those, left and right, beside which it may not stand up ..."""
STANDS_UP_M = 0.25
"""... by more than this: the flank of something broad, not ground."""


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
        supported, slope = self._follow(lowest, sensor_height_m)
        known = np.where(supported, lowest, np.float32(-sensor_height_m))
        surface = _across(_along(known, supported, _across(_across(slope), AROUND), self.grid.range_m))
        beside = _across(surface, AROUND)
        np.copyto(surface, beside, where=surface - beside > np.float32(STANDS_UP_M))
        height: Float32 = points.z - surface.ravel().take(cell)
        return height

    def _lowest(self, points: Columns, cell: Int, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) lowest return of each cell that could be ground, infinite where there is none."""
        reach = points.root * points.root
        reach *= np.float32(self.max_slope)
        reach += np.float32(START_M)
        plausible = np.abs(points.z + np.float32(sensor_height_m)) < reach
        plausible &= points.root > np.float32(self.near)
        lowest = np.full(self.grid.size, np.inf, np.float32)
        np.minimum.at(lowest, cell, np.where(plausible, points.z, np.float32(np.inf)))
        return lowest.reshape(-1, SECTORS)

    def _follow(self, lowest: Float32, sensor_height_m: float) -> tuple[Bool, Float32]:
        """(rings, SECTORS) cells whose lowest return is ground: a short step a ring, all rays at once.

        Also the (1, SECTORS) slope at which each ray met its last ground.
        """
        steepest, gain, noise, bridge = (np.float32(v) for v in (self.max_slope, GAIN, NOISE_M, BRIDGE_M))
        ray = np.zeros((4, SECTORS), np.float32)  # of the last ground on each ray
        height, at, slope, bend = ray
        height[:], bend[:] = -sensor_height_m, steepest
        step = np.zeros_like(ray)
        step[3] = BEND
        supported = np.zeros(lowest.shape, np.bool_)
        for ring in np.flatnonzero(np.isfinite(lowest).any(axis=1)).tolist():
            here, range_m = lowest[ring], self.grid.range_m[ring]
            gap = range_m - at
            reach = np.minimum(gap, bridge)
            rise = here - height
            found = np.less(np.abs(rise - slope * reach), reach * bend + noise, out=supported[ring])
            step[0], step[1] = here, range_m
            step[2] = np.minimum(np.maximum(slope + gain * (rise / gap - slope), -steepest), steepest)
            np.copyto(ray, step, where=found)
        return supported, slope[None]


def _along(ground: Float32, supported: Bool, slope: Float32, range_m: Float32) -> Float32:
    """The surface with its gaps filled by straight lines along each ray, and going on beyond the last support."""
    rings, sectors = ground.shape
    supported = supported.copy()
    supported[0] = True
    cell = np.arange(rings * sectors).reshape(rings, sectors)
    before = np.maximum.accumulate(np.where(supported, cell, 0), axis=0)
    after = np.minimum.accumulate(np.where(supported, cell, cell.size)[::-1], axis=0)[::-1]
    beyond = after == cell.size
    after = np.where(beyond, before, after)
    range_of = np.repeat(range_m, sectors)
    low, near = ground.take(before), range_of.take(before)
    high, far = ground.take(after), range_of.take(after)
    since = range_m[:, None] - near
    line: Float32 = low + (high - low) * (since / np.maximum(far - near, np.float32(1e-3)))
    line += beyond * np.minimum(since, np.float32(ONWARD_M)) * (np.float32(ONWARD) * slope)
    return line


def _across(surface: Float32, step: int = 1) -> Float32:
    """The surface with each cell the median of itself and of those so many sectors to its left and right."""
    left, right = np.roll(surface, step, axis=1), np.roll(surface, -step, axis=1)
    low, high = np.minimum(left, surface), np.maximum(left, surface)
    median: Float32 = np.maximum(low, np.minimum(high, right))
    return median
