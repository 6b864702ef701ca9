"""Ray casting of convex solids into a range image with a depth buffer (slab and quadric tests)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.types import Bool, Float32, Float64, Int
from modt_simulation.sensors import SensorModel
from modt_simulation.solids import Solids

Int32 = NDArray[np.int32]

NO_SOLID = -1
"""Index of the solid hit by a ray that hits none."""
NEAREST_M = np.float32(0.05)
"""Least horizontal distance of a hit."""
BATCH_RAYS = 1000
"""Most rays of a window that is cast in a batch; a larger one is cast by itself."""
CHUNK_RAYS = 16_384
"""Rays of a batch, which fit the cache."""


@dataclass(frozen=True)
class RangeImage:
    """First hits of the rays of a sweep."""

    distance: Float32  # (B, A) horizontal distance to the first surface [m]; infinite where there is none
    solid: Int32  # (B, A) index of the solid hit, NO_SOLID for the ground or the sky


@dataclass(frozen=True)
class Windows:
    """Bounds of each solid in the range image. A solid across the seam has two windows."""

    solid: Int  # (W,) index of the solid, nearest first
    rows: Int  # (W, 2) first row, and one past the last
    columns: Int  # (W, 2) first column, and one past the last
    near: Float32  # (W,) least horizontal distance of the solid [m]

    @property
    def area(self) -> Int:
        """(W,) number of rays."""
        return np.asarray(np.diff(self.rows, axis=1)[:, 0] * np.diff(self.columns, axis=1)[:, 0])


@dataclass(frozen=True)
class Shape:
    """Kinds of surfaces that bound a solid, and their intersection with rays."""

    code: int  # 1 for a box, plus 2 for a quadric, plus 4 for foliage, plus 8 times the number of cutting planes

    @classmethod
    def codes(cls, solids: Solids) -> Int:
        """(n,) code of each solid."""
        rounded = (solids.quadric > 0).any(axis=1)
        boxed = (solids.quadric * np.square(solids.half) < np.float32(0.999)).any(axis=1)
        cut = solids.cuts[:, :, :3].any(axis=2).sum(axis=1)
        return np.asarray(boxed + 2 * rounded + 4 * np.isfinite(solids.density) + 8 * cut)

    @property
    def foliage(self) -> bool:
        """Whether rays end inside rather than on the surface."""
        return bool(self.code & 4)

    @property
    def cuts(self) -> int:
        """Number of cutting planes."""
        return self.code >> 3

    def cross(
        self, direction: list[Float32], start: list[Float32], half: Float32, quadric: Float32, cuts: Iterable[Float32]
    ) -> tuple[Float32, Float32]:
        """Horizontal distances at which rays enter and leave a solid [m]; enter >= leave, or NaN, for a miss.

        Directions and starts of the rays are three components in the frame of the solid, broadcastable; half sides,
        quadric and cutting planes are those of the solid, or of each ray's solid.
        """
        enter: Float32 = np.full(1, -np.inf, np.float32)
        leave: Float32 = -enter
        spans: list[tuple[Any, Any]] = []  # middle of the stretch of a ray between two surfaces, and half its length
        if self.code & 1:
            for i in range(3):
                inverse = 1 / direction[i]
                spans.append((start[i] * -inverse, half[i] * np.abs(inverse)))
        if self.code & 2:
            a = _sum(quadric[i] * direction[i] * direction[i] for i in range(3))
            middle = -_sum(quadric[i] * direction[i] * start[i] for i in range(3)) / a
            # Squared distance of the ray's nearest point: float32 holds it where b^2 - ac would cancel.
            outside = _sum(quadric[i] * np.square(start[i] + middle * direction[i]) for i in range(3))
            spans.append((middle, np.sqrt((1 - outside) / a)))  # NaN where the ray misses
        for middle, reach in spans:
            enter = np.maximum(enter, middle - reach)
            leave = np.minimum(leave, middle + reach)
        for cut, _ in zip(cuts, range(self.cuts), strict=False):
            slope = cut[0] * direction[0] + cut[1] * direction[1] + cut[2] * direction[2]
            at = (cut[3] - (cut[0] * start[0] + cut[1] * start[1] + cut[2] * start[2])) / slope
            enter = np.where(slope < 0, np.maximum(enter, at), enter)
            leave = np.where(slope > 0, np.minimum(leave, at), leave)
        return enter, leave


def _sum(terms: Iterable[Float32]) -> Float32:
    return reduce(np.add, terms)


class _Columns:
    """Columns of the solids by component, contiguous for fast gathering."""

    def __init__(self, solids: Solids) -> None:
        self.rotation: Float32 = np.ascontiguousarray(solids.rotation.transpose(1, 2, 0))
        self.shift: Float32 = np.ascontiguousarray(-np.einsum("nji,nj->in", solids.rotation, solids.centre))
        self.half: Float32 = np.ascontiguousarray(solids.half.T)
        self.quadric: Float32 = np.ascontiguousarray(solids.quadric.T)
        self.cuts = solids.cuts
        self.density = solids.density


class RayCaster:
    """Casts the rays of one sensor.

    A ray is a point (0, 0, origin) and a direction (cos azimuth, sin azimuth, tangent): its parameter is the
    horizontal distance. Each solid is tested with the rays of its window alone.
    """

    def __init__(self, sensor: SensorModel, batch_rays: int = BATCH_RAYS) -> None:
        self.sensor = sensor
        self.batch_rays = batch_rays
        self.cos = np.cos(sensor.azimuth_rad).astype(np.float32)
        self.sin = np.sin(sensor.azimuth_rad).astype(np.float32)
        self.tangent = sensor.tangent[:, None]
        self.origin = np.broadcast_to(np.asarray(sensor.origin_m, np.float32), sensor.shape[0])[:, None]

    def cast(self, solids: Solids, ground: Float32, depth: Float32) -> RangeImage:
        """First hit of each ray.

        Large windows are cast one by one, nearest first, so that hidden ones are skipped; small ones in batches.
        `ground` (B, A) is the horizontal distance to the ground [m], infinite where a ray misses it; `depth` (B, A)
        the optical depth at which each ray ends in foliage, exponentially distributed.
        """
        image = RangeImage(ground.copy(), np.full(ground.shape, NO_SOLID, np.int32))
        windows = self.windows(solids)
        large = windows.area > self.batch_rays
        codes = Shape.codes(solids)[windows.solid]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for w in np.flatnonzero(large).tolist():
                self._cast_window(solids, Shape(int(codes[w])), windows, w, depth, image)
            self._cast_rays(_Columns(solids), codes, windows, np.flatnonzero(~large), depth, image)
        return image

    def _cast_window(
        self, solids: Solids, shape: Shape, windows: Windows, w: int, depth: Float32, image: RangeImage
    ) -> None:
        """Cast the rays of one window."""
        rows = slice(*windows.rows[w])
        columns = slice(*windows.columns[w])
        nearest = image.distance[rows, columns]
        if windows.near[w] > nearest.max():
            return
        k = int(windows.solid[w])
        R = solids.rotation[k]
        across = R[0][:, None] * self.cos[columns] + R[1][:, None] * self.sin[columns]
        direction = [across[i] + R[2, i] * self.tangent[rows] for i in range(3)]
        start = [R[2, i] * self.origin[rows] - solids.centre[k] @ R[:, i] for i in range(3)]
        enter, leave = shape.cross(direction, start, solids.half[k], solids.quadric[k], solids.cuts[k])
        if shape.foliage:
            enter = np.maximum(enter, NEAREST_M) + depth[rows, columns] / solids.density[k]
        hit = (enter < leave) & (enter < nearest) & (enter > NEAREST_M)
        np.copyto(nearest, enter, where=hit)
        np.copyto(image.solid[rows, columns], k, where=hit)

    def _cast_rays(
        self, table: _Columns, codes: Int, windows: Windows, which: Int, depth: Float32, image: RangeImage
    ) -> None:
        """Cast some windows in batches of the same shape, by the (W,) codes of all."""
        for code in np.unique(codes[which]).tolist():
            group = which[codes[which] == code]
            part = np.cumsum(windows.area[group]) // CHUNK_RAYS
            for chunk in np.split(group, np.flatnonzero(np.diff(part)) + 1):
                self._cast_chunk(table, Shape(code), windows, chunk, depth, image)

    def _cast_chunk(
        self, table: _Columns, shape: Shape, windows: Windows, chunk: Int, depth: Float32, image: RangeImage
    ) -> None:
        """Cast the rays of the windows of a chunk, which have one shape."""
        nearest = image.distance.reshape(-1)
        ray, row, column, k = self._pairs(windows, chunk, nearest)
        cos = self.cos[column]
        sin = self.sin[column]
        tangent = self.tangent[row, 0]
        origin = self.origin[row, 0]
        R = table.rotation
        up = [R[2][i][k] for i in range(3)]
        direction = [R[0][i][k] * cos + R[1][i][k] * sin + up[i] * tangent for i in range(3)]
        start = [up[i] * origin + table.shift[i][k] for i in range(3)]
        cuts = table.cuts[k].transpose(1, 2, 0) if shape.cuts else ()
        enter, leave = shape.cross(direction, start, table.half[:, k], table.quadric[:, k], cuts)
        if shape.foliage:
            enter = np.maximum(enter, NEAREST_M) + depth.reshape(-1)[ray] / table.density[k]
        hit = np.flatnonzero((enter < leave) & (enter > NEAREST_M) & (enter < nearest[ray]))
        # Several solids may hit one ray: first the distance of the nearest, then the solid that is there.
        ray = ray[hit]
        np.minimum.at(nearest, ray, enter[hit])
        first = enter[hit] == nearest[ray]
        image.solid.reshape(-1)[ray[first]] = k[hit[first]]

    def _pairs(self, windows: Windows, chunk: Int, nearest: Float32) -> tuple[Int, Int, Int, Int]:
        """Ray, row, column and solid of every pair in some windows that is not occluded by an earlier hit."""
        area = windows.area[chunk]
        window = np.repeat(chunk, area)
        # number of each pair in its window, which is counted row by row
        number = np.arange(len(window)) - np.repeat(np.cumsum(area) - area, area)
        down, along = np.divmod(number, np.diff(windows.columns, axis=1)[window, 0])
        row = windows.rows[window, 0] + down
        column = windows.columns[window, 0] + along
        ray = row * self.sensor.shape[1] + column
        open_ = np.flatnonzero(windows.near[window] < nearest[ray])
        return ray[open_], row[open_], column[open_], windows.solid[window[open_]]

    def windows(self, solids: Solids) -> Windows:
        """Windows of the solids within range and field of view."""
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], np.float32)
        arm = (signs * solids.half[:, None]) @ solids.rotation.transpose(0, 2, 1)
        corners = (solids.centre[:, None] + arm).astype(np.float32, copy=False)
        near = self._nearest(solids)
        rows = self._row_range(corners, near)
        low, high = _azimuth_range(solids, corners, near < NEAREST_M)
        inside = (near < self.sensor.max_range_m) & (rows[:, 1] > rows[:, 0])
        parts = []
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            columns = np.searchsorted(self.sensor.azimuth_rad, np.stack([low, high], axis=1) + turn)
            solid = np.flatnonzero(inside & (columns[:, 1] > columns[:, 0]))
            parts.append(np.column_stack([solid, rows[solid], columns[solid]]))
        window = np.concatenate(parts)
        window = window[np.argsort(near[window[:, 0]], kind="stable")]
        return Windows(window[:, 0], window[:, 1:3], window[:, 3:5], near[window[:, 0]])

    def _row_range(self, corners: Float32, near: Float32) -> Int:
        """(n, 2) first row, and one past the last, whose beams may meet solids of (n, 8, 3) corners."""
        near = np.maximum(near, NEAREST_M)
        far = np.hypot(corners[..., 0], corners[..., 1]).max(axis=1)
        rise = corners[..., 2].max(axis=1) - self.origin.min()
        fall = corners[..., 2].min(axis=1) - self.origin.max()
        steepest = np.where(rise > 0, rise / near, rise / far)
        deepest = np.where(fall < 0, fall / near, fall / far)
        falling = -self.tangent[:, 0]
        first = np.searchsorted(falling, -steepest)
        return np.stack([first, np.searchsorted(falling, -deepest, side="right")], axis=1)

    def _nearest(self, solids: Solids) -> Float32:
        """(n,) least horizontal distance [m], a lower bound for tilted solids."""
        upright: Bool = np.abs(solids.rotation[:, 2, 2]) > 0.99
        R = solids.rotation
        u = np.abs(np.einsum("nji,nj->ni", R[:, :2, :2], solids.centre[:, :2]))
        gap = np.maximum(u - solids.half[:, :2] - 0.15 * solids.half[:, 2:], 0)
        exact = np.hypot(gap[:, 0], gap[:, 1])
        radius = np.linalg.norm(solids.half, axis=1)
        loose = np.maximum(np.hypot(solids.centre[:, 0], solids.centre[:, 1]) - radius, 0)
        return np.asarray(np.where(upright, exact, loose).astype(np.float32))


def _azimuth_range(solids: Solids, corners: Float32, around: Bool) -> tuple[Float64, Float64]:
    """(n,) least and greatest azimuth of (n, 8, 3) corners, about that of the centre; `around` the sensor, all."""
    azimuth = np.arctan2(solids.centre[:, 1], solids.centre[:, 0]).astype(np.float64)
    c = np.cos(azimuth)[:, None]
    s = np.sin(azimuth)[:, None]
    ahead = c * corners[..., 0] + s * corners[..., 1]
    left = c * corners[..., 1] - s * corners[..., 0]
    off = np.arctan2(left, ahead)
    low = azimuth + np.where(around, -np.pi, off.min(axis=1))
    high = azimuth + np.where(around, np.pi, off.max(axis=1))
    return low, high
