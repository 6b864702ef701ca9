"""Ground as piece-wise planes (section III-A), one height a polar cell, traced outwards.

Arrays of a value a cell have the shape (rings, SECTORS): a column of them is a ray from the sensor outwards.
"""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.gaps import EDGE, FIRST, LAST, NO_GAPS
from modt.segmentation.grids import SECTORS, PointColumns, PolarGrid
from modt.segmentation.ground_rays import POSITION_MASK, POSITIONS, Rays, Slopes, position
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.tuning import GroundTuning, PolarGridTuning
from modt.types import Bool, Float32, Int

QUARTERS = 4
"""Parts of a ring over which the roughness of the ground is measured."""


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
        self.slopes = Slopes.of(max_slope_deg, tuning)

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
        above_m = surface + (outer - surface) * position(lowest) - lowest
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
        reach *= self.slopes.hill_slope
        reach += self.tuning.noise_m
        plausible = np.abs(points.z + np.float32(sensor_height_m)) < reach
        plausible &= points.sqrt_range > self.min_sqrt_range
        position = (points.sqrt_range * np.float32(self.grid.rings_per_unit * POSITIONS)).astype(np.int32)
        bits = (points.z.view(np.int32) & ~POSITION_MASK) | (position & POSITION_MASK)
        z = np.where(plausible, bits.view(np.float32), np.inf)
        return label_min(z, cell, self.grid.size).reshape(-1, SECTORS)

    def range_m(self, lowest: Float32, ring: Int) -> Float32:
        """(...) range of the lowest returns of cells of rings [m]."""
        sqrt_range = (ring.astype(np.float32) + position(lowest)) * np.float32(self.grid.ring_step)
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
        rays = Rays(self.slopes, self.tuning, lowest.copy(), sensor_height_m)
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


def _median_across(surface: Float32, step: int = 1) -> Float32:
    """(rings, SECTORS) median of each cell and the cells `step` sectors to its left and right."""
    left = np.roll(surface, step, axis=1)
    right = np.roll(surface, -step, axis=1)
    low = np.minimum(left, surface)
    high = np.maximum(left, surface)
    median: Float32 = np.maximum(low, np.minimum(high, right))
    return median
