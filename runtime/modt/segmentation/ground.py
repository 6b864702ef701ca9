"""Ground as piece-wise planes (section III-A), one height a polar cell, traced outwards."""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.grids import SECTORS, PointColumns, PolarGrid
from modt.segmentation.groups import label_max, label_min
from modt.types import Bool, Float32, Int

DEFAULT_HEIGHT_M = 1.73
"""Height of the sensor while no ground is in sight: that of KITTI's sensor."""
HEIGHT_SWEEPS = 5
"""First sweeps whose median is the estimate of the height."""
HEIGHT_RANGE_M, HEIGHT_BIN_M, MIN_HEIGHT_CELLS = 15.0, 0.05, 12
"""Farthest cell used for the height; width of a bin of depths; least number of ground cells in three bins."""
HORIZON_BEAMS = 2.0
"""Cells less than this many beams below the horizon say nothing of the height."""

NOISE_M = 0.1
"""Greatest residual of a lowest return on the plane of its ray."""
NEAR_M = 1.5
"""Greatest distance over which ground rises by `max_slope_deg`, from one ground cell of a ray to the next."""
MAX_GAP_M = 6.0
"""The same on and beside a ramp; distance over which the running slope of a ray is extrapolated."""
RAMP_SHARE = 0.3
"""A ray is on a ramp when its running slope exceeds this share of `max_slope_deg`."""
SLOPE_GAIN = 0.2
"""Weight of the newest slope in the running slope of a ray."""
FLAT_M, FLAT_SLOPE = 0.1, 0.2
"""Greatest height range of the returns of a flat cell, and its growth with the width of the cell."""
BONNET_RANGE_M = 11.0
"""From this range on, cells are as deep as a bonnet, 1 m: above a flank, the next return may lie in the next cell."""
FLANK_SECTORS, FLANK_M = 3, 0.25
"""A surface this far above the median of the rays so many sectors beside it is the side of a vehicle."""


class HeightEstimator:
    """Mode of the depths of flat cells around the sensor, median over the first sweeps.

    Cells on walls are excluded, since they are not flat: indoors they outnumber the cells on the floor.

    Args:
        sensor: range and beam spacing.
    """

    def __init__(self, sensor: SensorConfig) -> None:
        max_range_m = min(HEIGHT_RANGE_M, sensor.max_range_m)
        self.near, self.far = np.sqrt(sensor.min_range_m), np.sqrt(max_range_m)
        self.grid = PolarGrid(max_range_m)
        range_m = np.repeat(self.grid.range_m, SECTORS).astype(np.float64)
        self.flat_m = FLAT_M + FLAT_SLOPE * np.repeat(self.grid.ring_width_m, SECTORS)
        self.horizon_m = HORIZON_BEAMS * float(sensor.beams.step_rad(np.zeros(1, np.float32)).item()) * range_m
        self.estimates_m: list[float] = []

    def height_m(self, points: Float32) -> float:
        """Median of the estimates of the first sweeps, this (N, 4) one included; the default before any [m]."""
        if len(self.estimates_m) < HEIGHT_SWEEPS:
            estimate = self._estimate(PointColumns.from_array(points))
            if estimate is not None:
                self.estimates_m.append(estimate)
        return float(np.median(self.estimates_m)) if self.estimates_m else DEFAULT_HEIGHT_M

    def _estimate(self, points: PointColumns) -> float | None:
        around = points.take(np.flatnonzero((points.sqrt_range > self.near) & (points.sqrt_range < self.far)))
        cell, bin_m = self.grid.cell(around), HEIGHT_BIN_M
        lowest, highest = (reduce(around.z, cell, self.grid.size) for reduce in (label_min, label_max))
        flat = (highest - lowest < self.flat_m) & (-lowest > self.horizon_m)
        depth = -lowest[flat].astype(np.float64)
        cells = np.bincount((depth / bin_m).astype(np.int64), minlength=1)
        in_three_bins = np.convolve(cells, np.ones(3, np.int64), mode="same")
        if in_three_bins.max() < MIN_HEIGHT_CELLS:
            return None
        mode = (int(np.argmax(in_three_bins)) + 0.5) * bin_m
        return float(depth[np.abs(depth - mode) < 1.5 * bin_m].mean())


class GroundEstimator:
    """Height of each point above the ground below it.

    The lowest return of a cell is ground if it continues the ground of its ray. It may rise by `max_slope_deg` over a
    short way, on and beside a ramp over a longer one. It may not rise at all where something stands in the cell or,
    far away, right behind it, since it may be a flank. It may lie lower by `max_slope_deg` all the way, since nothing
    else does. Cells without ground are interpolated along the ray; beyond its last one, the ground is level, but a
    ramp goes on for MAX_GAP_M.

    Args:
        sensor: range.
        max_slope_deg: steepest ground.
    """

    def __init__(self, sensor: SensorConfig, max_slope_deg: float) -> None:
        self.grid = PolarGrid(sensor.max_range_m)
        flat_m = FLAT_M + FLAT_SLOPE * self.grid.ring_width_m
        self.flat_m: Float32 = flat_m[:, None].astype(np.float32)
        self.bonnet_ring = int(np.searchsorted(self.grid.range_m, BONNET_RANGE_M))
        self.min_sqrt_range = np.float32(np.sqrt(sensor.min_range_m))
        steepest_rad = np.deg2rad(max_slope_deg)
        self.max_slope, self.ramp_slope = np.tan([steepest_rad, RAMP_SHARE * steepest_rad]).tolist()

    def height_above(self, points: PointColumns, sensor_height_m: float) -> Float32:
        """(N,) height of each point above the ground [m]."""
        cell = self.grid.cell(points)
        lowest = self._lowest(points, cell, sensor_height_m)
        is_ground, is_ramp, slope = self.trace(lowest, self._stands(points, cell, lowest), sensor_height_m)
        surface = _median_across(self._interpolate(lowest, is_ground, slope, sensor_height_m))
        beside = _median_across(surface, FLANK_SECTORS)
        flank = surface - beside > np.float32(FLANK_M)
        np.copyto(surface, beside, where=np.where(is_ramp, surface < beside, flank))  # what stands on a ramp hides it
        height: Float32 = points.z - surface.ravel().take(cell)
        return height

    def _lowest(self, points: PointColumns, cell: Int, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) lowest return of each cell that can be ground [m], infinite without any."""
        reach = points.sqrt_range * points.sqrt_range
        reach *= np.float32(self.max_slope)
        reach += np.float32(NOISE_M)
        plausible = np.abs(points.z + np.float32(sensor_height_m)) < reach
        plausible &= points.sqrt_range > self.min_sqrt_range
        z = np.where(plausible, points.z, np.float32(np.inf))
        return label_min(z, cell, self.grid.size).reshape(-1, SECTORS)

    def _stands(self, points: PointColumns, cell: Int, lowest: Float32) -> Bool:
        """(rings, SECTORS) cells in which, or right behind which, something stands: returns far above the lowest."""
        highest, far = label_max(points.z, cell, self.grid.size).reshape(-1, SECTORS), self.bonnet_ring
        highest[far:-1] = np.maximum(highest[far:-1], highest[far + 1 :])
        stands: Bool = highest > lowest + self.flat_m
        return stands

    def trace(self, lowest: Float32, stands: Bool, sensor_height_m: float) -> tuple[Bool, Bool, Float32]:
        """(rings, SECTORS) ground cells, and cells on and beside a ramp, where no surface is a vehicle's side.

        With them comes the (SECTORS,) slope at the last ground cell of each ray that ends on a ramp, else 0.
        All rays advance together, ring by ring, from the foot of the sensor.
        """
        max_slope, ramp = np.float32(self.max_slope), np.float32(self.ramp_slope)
        gain, noise, max_gap, near = (np.float32(v) for v in (SLOPE_GAIN, NOISE_M, MAX_GAP_M, NEAR_M))
        last = np.zeros((3, SECTORS), np.float32)  # ground cell of each ray
        height, at, slope = last
        height[:] = -sensor_height_m
        step, bend_m = np.zeros_like(last), np.full(SECTORS, near)
        flat = ~stands
        is_ground, is_ramp = np.zeros((2, *lowest.shape), np.bool_)
        for ring, (here, range_m) in enumerate(zip(lowest, self.grid.range_m, strict=True)):
            gap = range_m - at
            reach = np.minimum(gap, max_gap)
            rise = here - height
            off = rise - slope * reach
            bound = np.minimum(gap, bend_m) * max_slope * flat[ring] + noise
            found = np.less(off, bound, out=is_ground[ring])
            found &= off > -(gap * max_slope + noise)
            step[0], step[1] = here, range_m
            step[2] = np.minimum(np.maximum(slope + gain * (rise / gap - slope), -max_slope), max_slope)
            np.copyto(last, step, where=found)
            on = np.abs(slope) > ramp
            is_ramp[ring] = on | np.roll(on, FLANK_SECTORS) | np.roll(on, -FLANK_SECTORS)
            bend_m = np.where(is_ramp[ring], max_gap, near)
        return is_ground, is_ramp, slope * on

    def _interpolate(self, lowest: Float32, is_ground: Bool, slope: Float32, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) surface, linear between the ground cells of a ray.

        Beyond the last one it goes on with the (SECTORS,) slope for MAX_GAP_M, but rises above no return.
        """
        ground = np.where(is_ground, lowest, np.float32(-sensor_height_m))
        rings, sectors = ground.shape
        is_ground = is_ground.copy()
        is_ground[0] = True
        cell = np.arange(rings * sectors).reshape(rings, sectors)
        before = np.maximum.accumulate(np.where(is_ground, cell, 0), axis=0)
        after = np.minimum.accumulate(np.where(is_ground, cell, cell.size)[::-1], axis=0)[::-1]
        beyond = after == cell.size
        after = np.where(beyond, before, after)
        range_of = np.repeat(self.grid.range_m, sectors)
        low, near = ground.take(before), range_of.take(before)
        high, far = ground.take(after), range_of.take(after)
        since = self.grid.range_m[:, None] - near
        ramp = low + slope * np.minimum(since, np.float32(MAX_GAP_M))
        between = low + (high - low) * (since / np.maximum(far - near, np.float32(1e-3)))
        surface: Float32 = np.where(beyond, np.minimum(ramp, np.maximum(lowest, low)), between)
        return surface


def _median_across(surface: Float32, step: int = 1) -> Float32:
    """(rings, SECTORS) median of each cell and the cells `step` sectors to its left and right."""
    left, right = np.roll(surface, step, axis=1), np.roll(surface, -step, axis=1)
    low, high = np.minimum(left, surface), np.maximum(left, surface)
    median: Float32 = np.maximum(low, np.minimum(high, right))
    return median
