"""Ground as piece-wise planes (section III-A), one height a polar cell, traced outwards.

Arrays of a value a cell have the shape (rings, SECTORS): a column of them is a ray from the sensor outwards.
"""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.grids import SECTORS, PointColumns, PolarGrid
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.tuning import GroundTuning, PolarGridTuning, SensorHeightTuning
from modt.types import Bool, Float32, Int

QUARTERS = 4
"""Parts of a ring over which the roughness of the ground is measured."""


class HeightEstimator:
    """Mode of the depths of flat cells around the sensor, median over the first sweeps.

    Cells on walls are excluded, since they are not flat: indoors they outnumber the cells on the floor.

    Args:
        sensor: range and beam spacing.
        tuning: which cells are used, and how many are a floor.
        polar: cells of the polar grid.
    """

    def __init__(
        self,
        sensor: SensorConfig,
        tuning: SensorHeightTuning = SensorHeightTuning(),
        polar: PolarGridTuning = PolarGridTuning(),
    ) -> None:
        self.tuning = tuning
        max_range_m = min(tuning.max_range_m, sensor.max_range_m)
        self.min_sqrt_range = np.sqrt(sensor.min_range_m)
        self.max_sqrt_range = np.sqrt(max_range_m)
        self.grid = PolarGrid(max_range_m, polar)
        self.flat_m = np.repeat(self.grid.flat_m, SECTORS)
        range_m = np.repeat(self.grid.range_m, SECTORS).astype(np.float64)
        level_step_rad = float(sensor.beams.step_rad(np.zeros(1, np.float32)).item())
        self.horizon_m = tuning.horizon_beams * level_step_rad * range_m
        self.estimates_m: list[float] = []

    def height_m(self, points: Float32) -> float:
        """Median of the estimates of the first sweeps, this (N, 4) one included; the default before any [m]."""
        if len(self.estimates_m) < self.tuning.sweeps:
            estimate = self._estimate(PointColumns.from_array(points))
            if estimate is not None:
                self.estimates_m.append(estimate)
        return float(np.median(self.estimates_m)) if self.estimates_m else self.tuning.default_m

    def _estimate(self, points: PointColumns) -> float | None:
        """Depth of the floor below the sensor in one sweep [m], None without one."""
        bin_m = self.tuning.bin_m
        used = (points.sqrt_range > self.min_sqrt_range) & (points.sqrt_range < self.max_sqrt_range)
        around = points.take(np.flatnonzero(used))
        cell = self.grid.cell(around)
        lowest = label_min(around.z, cell, self.grid.size)
        highest = label_max(around.z, cell, self.grid.size)
        flat = (highest - lowest < self.flat_m) & (-lowest > self.horizon_m)
        depth = -lowest[flat].astype(np.float64)
        cells = np.bincount((depth / bin_m).astype(np.int64), minlength=1)
        in_three_bins = np.convolve(cells, np.ones(3, np.int64), mode="same")
        if in_three_bins.max() < self.tuning.min_cells:
            return None
        mode = (int(np.argmax(in_three_bins)) + 0.5) * bin_m
        return float(depth[np.abs(depth - mode) < 1.5 * bin_m].mean())


class GroundEstimator:
    """Height of each point above the ground below it.

    The lowest return of a cell is ground if it continues the ground of its ray. It may rise by `max_slope_deg` over a
    short way, on and beside a ramp over a longer one. It may not rise at all where something stands in the cell or,
    far away, right behind it, since it may be a flank. It may fall by `max_slope_deg` over any gap, since only ground
    lies lower. Cells without ground are interpolated along the ray; beyond its last one, the ground is level, but a
    ramp goes on for `max_gap_m`.

    Args:
        sensor: range.
        max_slope_deg: steepest ground.
        tuning: bounds on ground that continues that of a ray.
        polar: cells of the polar grid.
    """

    def __init__(
        self,
        sensor: SensorConfig,
        max_slope_deg: float,
        tuning: GroundTuning = GroundTuning(),
        polar: PolarGridTuning = PolarGridTuning(),
    ) -> None:
        self.tuning = tuning
        self.grid = PolarGrid(sensor.max_range_m, polar)
        self.flat_m: Float32 = self.grid.flat_m.astype(np.float32)
        self.bonnet_ring = int(np.searchsorted(self.grid.range_m, tuning.bonnet_range_m))
        self.min_sqrt_range = np.float32(np.sqrt(sensor.min_range_m))
        # (near rings,) sectors to the left and right of a cell that a low thing does not reach.
        near_m = self.grid.range_m[self.grid.range_m < tuning.low_range_m]
        sectors = np.rint(tuning.low_half_width_m / (2 * np.pi / SECTORS * near_m))
        self.low_sectors = np.clip(sectors, tuning.flank_sectors, SECTORS // 4).astype(np.int32)
        self.near_rings = len(near_m)
        steepest_rad = np.deg2rad(max_slope_deg)
        self.max_slope, self.ramp_slope = np.tan([steepest_rad, tuning.ramp_share * steepest_rad]).tolist()

    def height_above(self, points: PointColumns, sensor_height_m: float) -> Float32:
        """(N,) height of each point above the ground [m]."""
        return self.heights(points, sensor_height_m)[0]

    def heights(self, points: PointColumns, sensor_height_m: float) -> tuple[Float32, Float32, Float32]:
        """(N,) height of each point above the ground, and (N,) height there from which it is clear of it [m].

        The latter is infinite in a cell in which no return is. With them comes the (rings, SECTORS) highest return of
        each cell [m, sensor frame], minus infinity without any.
        """
        cell = self.grid.cell(points)
        lowest = self._lowest(points, cell, sensor_height_m)
        highest = label_max(points.z, cell, self.grid.size).reshape(-1, SECTORS)
        clear_m = self.clear_m(lowest, highest)
        is_ground, is_ramp, slope = self.trace(lowest, self._stands(points, cell, lowest), sensor_height_m)
        surface = _median_across(self._interpolate(lowest, is_ground, slope, sensor_height_m))
        # The ground under a vehicle, and under what stands on a ramp, is that of the rays beside it.
        beside = _median_across(surface, self.tuning.flank_sectors)
        flank = surface - beside > self.tuning.flank_m
        np.copyto(surface, beside, where=np.where(is_ramp, surface < beside, flank))
        # So is the ground under low things, which seem a rise of it.
        for ring, sectors in enumerate(self.low_sectors):
            beside = _median_across(surface[[ring]], sectors)[0]
            raised = (surface[ring] - beside > self.tuning.low_m) & ~is_ramp[ring]
            np.copyto(surface[ring], beside, where=raised)
        clear_m[highest - surface <= clear_m] = np.inf
        height: Float32 = points.z - surface.ravel().take(cell)
        return height, clear_m.ravel().take(cell), highest

    def clear_m(self, lowest: Float32, highest: Float32) -> Float32:
        """(rings, SECTORS) height above the ground from which returns are clear of it [m].

        It follows the measured roughness: the height range of the returns of a cell in which nothing stands, in the
        median of the cells of the same ring and quarter of the circle. It is infinite where there is none.
        """
        shape = len(lowest), QUARTERS, SECTORS // QUARTERS
        ranges = highest - lowest
        is_flat = np.isfinite(lowest) & (ranges <= self.flat_m[:, None])
        ranges[~is_flat] = np.inf
        ranges = ranges.reshape(shape)
        ranges.sort(axis=2)  # cells without returns, and where something stands, come last
        last = np.maximum(np.isfinite(ranges).sum(axis=2, keepdims=True) - 1, 0)
        median = np.take_along_axis(ranges, last // 2, axis=2)
        clear_m = np.float32(self.tuning.clear_m) + median
        return np.broadcast_to(clear_m, shape).reshape(lowest.shape).copy()

    def _lowest(self, points: PointColumns, cell: Int, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) lowest return of each cell that can be ground [m], infinite without any."""
        reach = points.sqrt_range * points.sqrt_range
        reach *= self.max_slope
        reach += self.tuning.noise_m
        plausible = np.abs(points.z + np.float32(sensor_height_m)) < reach
        plausible &= points.sqrt_range > self.min_sqrt_range
        z = np.where(plausible, points.z, np.inf)
        return label_min(z, cell, self.grid.size).reshape(-1, SECTORS)

    def _stands(self, points: PointColumns, cell: Int, lowest: Float32) -> Bool:
        """(rings, SECTORS) cells in which, or right behind which, something stands: returns far above the lowest."""
        highest = label_max(points.z, cell, self.grid.size).reshape(-1, SECTORS)
        far = self.bonnet_ring
        highest[far:-1] = np.maximum(highest[far:-1], highest[far + 1 :])
        stands: Bool = highest > lowest + self.flat_m[:, None]
        return stands

    def trace(self, lowest: Float32, stands: Bool, sensor_height_m: float) -> tuple[Bool, Bool, Float32]:
        """(rings, SECTORS) ground cells, and cells on and beside a ramp, where no surface is a vehicle's side.

        With them comes the (SECTORS,) slope at the last ground cell of each ray that ends on a ramp, else 0.
        All rays advance together, ring by ring, from the foot of the sensor.
        """
        rays = _Rays(self, sensor_height_m)
        is_ground = np.zeros(lowest.shape, np.bool_)
        is_ramp = np.zeros(lowest.shape, np.bool_)
        for ring, range_m in enumerate(self.grid.range_m):
            is_ground[ring] = rays.advance(range_m, lowest[ring], stands[ring])
            is_ramp[ring] = rays.beside_ramp
        return is_ground, is_ramp, rays.slope * rays.on_ramp

    def _interpolate(self, lowest: Float32, is_ground: Bool, slope: Float32, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) surface, linear between the ground cells of a ray.

        Beyond the last one it goes on with the (SECTORS,) slope for `max_gap_m`, but rises above no return.
        """
        ground = np.where(is_ground, lowest, np.float32(-sensor_height_m))
        is_ground = is_ground.copy()
        is_ground[0] = True  # the foot of the sensor
        cell = np.arange(is_ground.size).reshape(is_ground.shape)
        before = np.maximum.accumulate(np.where(is_ground, cell, 0), axis=0)
        after = np.minimum.accumulate(np.where(is_ground, cell, cell.size)[::-1], axis=0)[::-1]
        beyond = after == cell.size
        after = np.where(beyond, before, after)
        range_m = np.repeat(self.grid.range_m, SECTORS)
        range_before = range_m.take(before)
        height_before = ground.take(before)
        since = self.grid.range_m[:, None] - range_before
        ramp = height_before + slope * np.minimum(since, self.tuning.max_gap_m)
        share = since / np.maximum(range_m.take(after) - range_before, 1e-3)
        between = height_before + (ground.take(after) - height_before) * share
        surface: Float32 = np.where(beyond, np.minimum(ramp, np.maximum(lowest, height_before)), between)
        return surface


class _Rays:
    """Last ground cell of each of the SECTORS rays, as all of them advance ring by ring."""

    def __init__(self, ground: GroundEstimator, sensor_height_m: float) -> None:
        self.ground = ground
        self.height_m = np.full(SECTORS, -sensor_height_m, np.float32)
        self.range_m = np.zeros(SECTORS, np.float32)
        self.slope = np.zeros(SECTORS, np.float32)  # running mean along the ray
        self.on_ramp = np.zeros(SECTORS, np.bool_)
        self.beside_ramp = self.on_ramp  # or on it

    def advance(self, range_m: np.float32, lowest: Float32, stands: Bool) -> Bool:
        """(SECTORS,) rays that find ground in the next ring.

        Args:
            range_m: range of the ring.
            lowest: (SECTORS,) lowest return of each cell of the ring [m], infinite without any.
            stands: (SECTORS,) cells in which something stands: the ground does not rise there.
        """
        tuning = self.ground.tuning
        max_slope = self.ground.max_slope
        gap = range_m - self.range_m
        rise = lowest - self.height_m
        residual = rise - self.slope * np.minimum(gap, tuning.max_gap_m)
        rise_range_m = np.where(self.beside_ramp, np.float32(tuning.max_gap_m), np.float32(tuning.near_m))
        found: Bool = residual < np.minimum(gap, rise_range_m) * max_slope * ~stands + tuning.noise_m
        found &= residual > -(gap * max_slope + tuning.noise_m)
        slope = self.slope + tuning.slope_gain * (rise / gap - self.slope)
        np.copyto(self.slope, np.minimum(np.maximum(slope, -max_slope), max_slope), where=found)
        np.copyto(self.height_m, lowest, where=found)
        np.copyto(self.range_m, range_m, where=found)
        self.on_ramp = np.abs(self.slope) > self.ground.ramp_slope
        left, right = (np.roll(self.on_ramp, step) for step in (tuning.flank_sectors, -tuning.flank_sectors))
        self.beside_ramp = self.on_ramp | left | right
        return found


def _median_across(surface: Float32, step: int = 1) -> Float32:
    """(rings, SECTORS) median of each cell and the cells `step` sectors to its left and right."""
    left = np.roll(surface, step, axis=1)
    right = np.roll(surface, -step, axis=1)
    low = np.minimum(left, surface)
    high = np.maximum(left, surface)
    median: Float32 = np.maximum(low, np.minimum(high, right))
    return median
