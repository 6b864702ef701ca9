"""Ground as piece-wise planes (section III-A), one height a polar cell, traced outwards.

Arrays of a value a cell have the shape (rings, SECTORS): a column of them is a ray from the sensor outwards.
"""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.gaps import EDGE, FIRST, LAST, NO_GAPS
from modt.segmentation.grids import SECTORS, PointColumns, PolarGrid
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.tuning import GroundTuning, PolarGridTuning, SensorHeightTuning
from modt.types import Bool, Float32, Int

QUARTERS = 4
"""Parts of a ring over which the roughness of the ground is measured."""
POSITIONS = 1024
"""Positions of a return in its ring that are told apart, a power of two."""
POSITION_MASK = np.int32(POSITIONS - 1)


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

    The lowest return of a cell is ground if it continues the ground of its ray. It may rise by `max_slope_deg` more
    than the running slope of the ray over a short way, on and beside a ramp over a longer one. It may not rise more
    where something stands in the cell, since it may be a flank or a bumper. Far away, and on a ray that has met no
    ground yet, what stands in the next ring counts as well. On such a ray the ground may not rise either unless it
    goes on behind: where the next `rings_behind` rings have no return, or one that lies lower again, the cell may be
    the side or the top of something low. Beyond `low_range_m` the ground of such a ray does not rise at all. Where
    ground goes on behind, it is also reached from known ground along the ring, from cell to cell: the sides of a
    valley. Known ground is level with the robot, or on a ray that has met ground before. The ground may fall by
    `max_slope_deg` more over any gap, since only ground lies lower. A ray that has lost the ground finds it again in
    a cell where nothing stands, if that is as high as ground on a ray beside it. The surface is linear between the
    ground returns of a ray; beyond its last one, the ground is level, but a ramp goes on for `max_gap_m`.

    Behind a crest or an edge, the foot of what stands there is hidden. Where something stands more than `near_m` from
    the last ground, and the lowest return of its cell is below the line of the ray, the ground is taken to be
    `hidden_m` lower, unless ground on a ray beside it is as high. The surface lies above no lowest return of a cell
    in which something stands. Something may stand in a cell with a return of the beam below a dead one, up to where
    that beam would have met it.

    Args:
        sensor: range.
        max_slope_deg: greatest change of the slope of the ground.
        tuning: bounds on ground that continues that of a ray.
        polar: cells of the polar grid.
        gaps: (n, 4) gaps of dead beams (`modt.segmentation.gaps`).
    """

    def __init__(
        self,
        sensor: SensorConfig,
        max_slope_deg: float,
        tuning: GroundTuning = GroundTuning(),
        polar: PolarGridTuning = PolarGridTuning(),
        gaps: Float32 = NO_GAPS,
    ) -> None:
        self.tuning = tuning
        self.gaps = gaps
        self.grid = PolarGrid(sensor.max_range_m, polar)
        self.flat_m: Float32 = self.grid.flat_m.astype(np.float32)
        self.bonnet_ring = int(np.searchsorted(self.grid.range_m, tuning.bonnet_range_m))
        # (rings,) way over which the returns of a cell are looked at for what stands [m].
        self.depth_m: Float32 = np.diff(self.grid.edge_m)
        self.depth_m[self.bonnet_ring :] *= 2
        self.min_sqrt_range = np.float32(np.sqrt(sensor.min_range_m))
        self.max_sqrt_range = np.float32(np.sqrt(sensor.max_range_m))
        # (near rings,) sectors to the left and right of a cell that a low thing does not reach.
        near_m = self.grid.range_m[self.grid.range_m < tuning.low_range_m]
        sectors = np.rint(tuning.low_half_width_m / (2 * np.pi / SECTORS * near_m))
        self.low_sectors = np.clip(sectors, tuning.flank_sectors, SECTORS // 4).astype(np.int32)
        self.near_rings = len(near_m)
        steepest_rad = np.deg2rad(max_slope_deg)
        self.max_slope, self.ramp_slope = np.tan([steepest_rad, tuning.ramp_share * steepest_rad]).tolist()
        self.max_rise_beside = float(2 * np.pi / SECTORS * self.max_slope)  # from ray to ray, at a range of 1 m
        self.hill_slope = float(np.tan(2 * steepest_rad))  # of a hill, seen from the slope of the hill opposite

    def height_above(self, points: PointColumns, sensor_height_m: float) -> Float32:
        """(N,) height of each point above the ground [m]."""
        return self.heights(points, sensor_height_m)[0]

    def heights(self, points: PointColumns, sensor_height_m: float) -> tuple[Float32, Float32, Float32]:
        """Heights of the points, heights from which they are clear of the ground, and highest returns.

        Returns:
            (N,) height of each point above the ground [m].
            (N,) height above ground from which a return in this cell is surely not ground [m]. It is infinite if the
            cell has no such return, or lies beyond `low_range_m`.
            (rings, SECTORS) highest return of each cell [m, sensor frame], minus infinity without any.
        """
        cell = self.grid.cell(points)
        lowest = self._lowest(points, cell, sensor_height_m)
        highest = label_max(points.z, cell, self.grid.size).reshape(-1, SECTORS)
        clear_m = self.clear_m(lowest, highest)
        tops = self._tops(self._across_gaps(points, cell, highest))
        rays = self.trace(lowest, tops, sensor_height_m)
        is_ramp = rays.is_ramp
        surface = _median_across(self._interpolate(rays.lowest, rays.is_ground, rays.end_slope, sensor_height_m))
        # The ground under a vehicle, and under what stands on a ramp, is that of the rays beside it.
        beside = _median_across(surface, self.tuning.flank_sectors)
        flank = surface - beside > self.tuning.flank_m
        np.copyto(surface, beside, where=np.where(is_ramp, surface < beside, flank))
        self._leave_low_things(surface, is_ramp)
        inner_m, outer_m = self._below_what_stands(surface, rays.lowest, rays.stands)
        clear_m[highest - inner_m <= clear_m] = np.inf
        clear_m[self.near_rings :] = np.inf
        inner = inner_m.ravel().take(cell)
        outer = outer_m.ravel().take(cell)
        ring_of_point = (cell // SECTORS).astype(np.float32)
        share = points.sqrt_range * np.float32(self.grid.rings_per_unit) - ring_of_point
        height: Float32 = points.z - (inner + (outer - inner) * share)
        return height, clear_m.ravel().take(cell), highest

    def _leave_low_things(self, surface: Float32, is_ramp: Bool) -> None:
        """Lower the (rings, SECTORS) surface under low things, which seem a rise of it, to that beside them.

        A crest is a rise as well, but the ground falls farther beyond the ground beside it.
        """
        for ring, sectors in enumerate(self.low_sectors):
            steps = sectors, min(2 * sectors, SECTORS // 4)
            beside, beyond = (_median_across(surface[[ring]], step)[0] for step in steps)
            fall_m = np.clip(beside - beyond, 0, self.tuning.low_m)
            raised = (surface[ring] - beside > self.tuning.low_m + fall_m) & ~is_ramp[ring]
            np.copyto(surface[ring], beside, where=raised)

    def _below_what_stands(self, surface: Float32, lowest: Float32, stands: Bool) -> tuple[Float32, Float32]:
        """(rings, SECTORS) surface at the inner and at the outer edge of each cell [m].

        Where something stands in a cell whose lowest return is below the surface, the surface of this cell goes down
        to it.
        """
        outer = np.concatenate([surface[1:], surface[-1:]])
        above_m = surface + (outer - surface) * _position(lowest) - lowest
        drop_m = np.where(stands & (above_m > self.tuning.noise_m), above_m, np.float32(0))
        return surface - drop_m, outer - drop_m

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
        """(rings, SECTORS) lowest return of each cell that can be ground [m], infinite without any.

        The last bits of each height are replaced by the position of the return in its ring, so that both are found
        at once: see `range_m`.
        """
        reach = points.sqrt_range * points.sqrt_range
        reach *= self.hill_slope
        reach += self.tuning.noise_m
        plausible = np.abs(points.z + np.float32(sensor_height_m)) < reach
        plausible &= points.sqrt_range > self.min_sqrt_range
        position = (points.sqrt_range * np.float32(self.grid.rings_per_unit * POSITIONS)).astype(np.int32)
        bits = (points.z.view(np.int32) & ~POSITION_MASK) | (position & POSITION_MASK)
        z = np.where(plausible, bits.view(np.float32), np.inf)
        return label_min(z, cell, self.grid.size).reshape(-1, SECTORS)

    def range_m(self, lowest: Float32, ring: Int) -> Float32:
        """(...) range of the lowest returns of cells of rings [m]."""
        sqrt_range = (ring.astype(np.float32) + _position(lowest)) * np.float32(self.grid.ring_step)
        range_m: Float32 = sqrt_range * sqrt_range
        return range_m

    def _across_gaps(self, points: PointColumns, cell: Int, highest: Float32) -> Float32:
        """(rings, SECTORS) height up to which something may stand in each cell, given its highest return [m]."""
        if not len(self.gaps):
            return highest
        standing = highest
        in_range = (points.sqrt_range > self.min_sqrt_range) & (points.sqrt_range < self.max_sqrt_range)
        range_m = points.sqrt_range * points.sqrt_range
        for gap in self.gaps:
            below = in_range & (points.z > range_m * gap[EDGE]) & (points.z < range_m * gap[FIRST])
            across_m = label_max((range_m * gap[LAST])[below], cell[below], self.grid.size)
            standing = np.maximum(standing, across_m.reshape(highest.shape))
        return standing

    def _tops(self, highest: Float32) -> Float32:
        """(rings, SECTORS) highest return in each cell and, far away, in the next ring [m]."""
        tops = highest.copy()
        far = self.bonnet_ring
        tops[far:-1] = np.maximum(highest[far:-1], highest[far + 1 :])
        return tops

    def trace(self, lowest: Float32, top: Float32, sensor_height_m: float) -> Rays:
        """The rays at their ends, given the (rings, SECTORS) lowest return and top of each cell [m].

        All rays advance together, ring by ring, from the foot of the sensor.
        """
        rays = Rays(self, lowest.copy(), sensor_height_m)
        range_m = self.range_m(lowest, np.arange(self.grid.rings)[:, None])
        lowest_behind = self._lowest_behind(lowest)
        # Where ground rises and goes on, what lies behind is not lower than this cell.
        goes_on = np.isfinite(lowest_behind) & (lowest_behind > lowest - self.tuning.noise_m)
        for ring in range(self.grid.rings):
            flat_m = self.flat_m[ring] + np.maximum(rays.slope, 0) * self.depth_m[ring]
            behind = min(ring + 1, self.grid.rings - 1)
            flat = top[ring] - lowest[ring] <= flat_m
            flat_behind = top[behind] - lowest[ring] <= flat_m
            rays.advance(ring, range_m[ring], flat, flat_behind, goes_on[ring])
        return rays

    def _lowest_behind(self, lowest: Float32) -> Float32:
        """(rings, SECTORS) lowest return in the next `rings_behind` rings of each ray [m], infinite without any.

        Only rings nearer than `low_range_m` are looked at.
        """
        lowest_behind = np.full_like(lowest, np.inf)
        near = lowest[: self.near_rings]
        for step in range(1, min(self.tuning.rings_behind, self.near_rings - 1) + 1):
            here = lowest_behind[: self.near_rings - step]
            np.minimum(here, near[step:], out=here)
        return lowest_behind

    def _interpolate(self, lowest: Float32, is_ground: Bool, slope: Float32, sensor_height_m: float) -> Float32:
        """(rings, SECTORS) surface at the inner edges of the rings, linear between the ground returns of a ray.

        Beyond the last one it goes on with the (SECTORS,) slope for `max_gap_m`, but rises above no return.
        """
        foot = np.full((1, SECTORS), -sensor_height_m, np.float32)
        height = np.concatenate([foot, np.where(is_ground, lowest, np.inf)])  # of ring k in row k + 1
        ring = np.arange(-1, self.grid.rings)
        range_m = self.range_m(height, np.maximum(ring, 0)[:, None])
        # Nodes are the ground cells of a ray, and its foot, which is row 0. Flat indices rise with the row, so
        # running extremes along a ray give the last node up to each cell, and the first one behind it.
        is_node = np.concatenate([np.ones_like(is_ground[:1]), is_ground])
        node = np.arange(is_node.size).reshape(is_node.shape)
        before = np.maximum.accumulate(np.where(is_node, node, 0), axis=0)[:-1]
        after = np.minimum.accumulate(np.where(is_node, node, node.size)[::-1], axis=0)[::-1][1:]
        beyond = after == node.size
        after = np.where(beyond, before, after)
        range_m[0] = 0.0  # the foot is below the sensor
        range_before = range_m.take(before)
        height_before = height.take(before)
        since = self.grid.edge_m[:-1, None] - range_before
        ramp = height_before + slope * np.minimum(since, self.tuning.max_gap_m)
        share = since / np.maximum(range_m.take(after) - range_before, np.float32(1e-3))
        between = height_before + (height.take(after) - height_before) * share
        surface: Float32 = np.where(beyond, np.minimum(ramp, np.maximum(lowest, height_before)), between)
        return surface


class Rays:
    """The SECTORS rays as they advance: last ground cell of each, and what was found in the rings passed.

    Attributes:
        lowest: (rings, SECTORS) height of the ground of each cell in which there is a return, if it is ground [m].
        is_ground: (rings, SECTORS) cells that are ground.
        is_ramp: (rings, SECTORS) cells on and beside a ramp, where no surface is a vehicle's side.
        stands: (rings, SECTORS) cells in which something stands.
    """

    def __init__(self, ground: GroundEstimator, lowest: Float32, sensor_height_m: float) -> None:
        self.ground = ground
        self.lowest = lowest
        self.is_ground: Bool = np.zeros(lowest.shape, np.bool_)
        self.is_ramp: Bool = np.zeros(lowest.shape, np.bool_)
        self.stands: Bool = np.zeros(lowest.shape, np.bool_)
        self.height_m = np.full(SECTORS, -sensor_height_m, np.float32)
        self.range_m = np.zeros(SECTORS, np.float32)
        self.slope = np.zeros(SECTORS, np.float32)  # running mean along the ray
        self.on_ramp: Bool = np.zeros(SECTORS, np.bool_)
        self.beside_ramp = self.on_ramp  # or on it

    @property
    def end_slope(self) -> Float32:
        """(SECTORS,) slope at the last ground cell of each ray that ends on a ramp, else 0."""
        return self.slope * self.on_ramp

    def advance(self, ring: int, range_m: Float32, flat: Bool, flat_behind: Bool, goes_on: Bool) -> None:
        """Find the rays that have ground in the next ring.

        Args:
            ring: that ring.
            range_m: (SECTORS,) range of the lowest returns [m].
            flat: (SECTORS,) cells in which nothing stands: the ground does not rise in the others.
            flat_behind: (SECTORS,) cells behind which nothing stands in the next ring.
            goes_on: (SECTORS,) cells behind which there are returns, none of them lower.
        """
        tuning = self.ground.tuning
        lowest = self.lowest[ring]  # a view: writes go to self.lowest, but keep the positions, and so range_m
        max_slope = self.ground.max_slope
        # How far each return is from the line that its ray was on, extrapolated no farther than max_gap_m.
        gap = range_m - self.range_m
        residual = lowest - self.height_m - self.slope * np.minimum(gap, tuning.max_gap_m)
        # It continues its own ray. Before a ray has met any ground, a rise has to go on behind as well.
        rise_range_m = np.where(self.beside_ramp, np.float32(tuning.max_gap_m), np.float32(tuning.near_m))
        may_rise = flat & ((flat_behind & goes_on) | (self.range_m > 0))
        found: Bool = residual < np.minimum(gap, rise_range_m) * max_slope * may_rise + tuning.noise_m
        may_fall = residual > -(gap * max_slope + tuning.noise_m)
        found &= may_fall
        # Or it continues the ground of a ray beside it. Only ground that is sure itself can be continued.
        below = residual < -tuning.noise_m
        sure = found & (flat | ~below)
        may_join = flat & (residual < gap * self.ground.hill_slope)
        # Ground that goes on behind is reached along the ring, but not from a ray that begins with a rise.
        known = sure & ((self.range_m > 0) | (residual < tuning.noise_m))
        sure |= self._reached(lowest, range_m, known, may_join & goes_on)
        beside = self._continues_beside(lowest, range_m, sure)
        found |= sure | (beside & may_join)
        # Or it is the lowest visible part of something whose foot a crest hides. Then the ground is still lower.
        stands = ~flat & may_fall
        hidden = ~beside & stands & below & (gap > tuning.near_m)
        np.copyto(lowest, _lowered(lowest, tuning.hidden_m), where=hidden)
        self._follow(lowest, range_m, found)
        self._keep(ring, found, stands)

    def _follow(self, lowest: Float32, range_m: Float32, found: Bool) -> None:
        """Move the last ground cells of the rays to those found in a ring."""
        gap = range_m - self.range_m
        # The running slope is a mean in which each stretch counts by its length.
        rise = lowest - self.height_m
        slope = self.slope + (rise - self.slope * gap) / (gap + np.float32(self.ground.tuning.slope_length_m))
        steepest = self.ground.hill_slope
        np.copyto(self.slope, np.minimum(np.maximum(slope, -steepest), steepest), where=found)
        np.copyto(self.height_m, lowest, where=found)
        np.copyto(self.range_m, range_m, where=found)

    def _reached(self, lowest: Float32, range_m: Float32, is_ground: Bool, may_be_reached: Bool) -> Bool:
        """(SECTORS,) ground of a ring, and the cells that it reaches along the ring, from cell to cell."""
        while True:
            more = self._continues_beside(lowest, range_m, is_ground, self.ground.tuning.noise_m)
            more &= may_be_reached & ~is_ground
            if not more.any():
                return is_ground
            is_ground = is_ground | more

    def _continues_beside(self, lowest: Float32, range_m: Float32, is_ground: Bool, noise_m: float = 0.0) -> Bool:
        """(SECTORS,) lowest returns of a ring that continue the ground of the same ring on a ray beside theirs."""
        max_rise_m = range_m * np.float32(self.ground.max_rise_beside) + np.float32(noise_m)
        ground = np.where(is_ground, lowest, np.float32(np.nan))
        left, right = (np.abs(lowest - np.roll(ground, step)) < max_rise_m for step in (1, -1))
        return np.asarray(left | right)

    def _keep(self, ring: int, found: Bool, stands: Bool) -> None:
        """Note the cells of a ring."""
        flank_sectors = self.ground.tuning.flank_sectors
        self.on_ramp = np.abs(self.slope) > self.ground.ramp_slope
        left, right = (np.roll(self.on_ramp, step) for step in (flank_sectors, -flank_sectors))
        self.beside_ramp = self.on_ramp | left | right
        self.is_ground[ring] = found
        self.is_ramp[ring] = self.beside_ramp
        self.stands[ring] = stands


def _position(lowest: Float32) -> Float32:
    """(...) positions of lowest returns in their rings, from 0 to 1."""
    return (lowest.view(np.int32) & POSITION_MASK).astype(np.float32) * np.float32(1 / POSITIONS)


def _lowered(lowest: Float32, by_m: float) -> Float32:
    """(...) heights of lowest returns less `by_m`, with their positions."""
    height: Float32 = lowest - np.float32(by_m)
    bits = (height.view(np.int32) & ~POSITION_MASK) | (lowest.view(np.int32) & POSITION_MASK)
    return bits.view(np.float32)


def _median_across(surface: Float32, step: int = 1) -> Float32:
    """(rings, SECTORS) median of each cell and the cells `step` sectors to its left and right."""
    left = np.roll(surface, step, axis=1)
    right = np.roll(surface, -step, axis=1)
    low = np.minimum(left, surface)
    high = np.maximum(left, surface)
    median: Float32 = np.maximum(low, np.minimum(high, right))
    return median
