"""Ray casting of convex pieces into a range image with a depth buffer."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.simulation.sensors import SensorModel
from modt.simulation.solids import Pieces
from modt.types import Bool, Float32, Int

NOTHING = -1
"""Piece met by a ray that meets none."""

NEAREST_M = np.float32(0.05)

BATCH_RAYS, CHUNK_RAYS = 1000, 16_384


@dataclass(frozen=True, slots=True)
class RangeImage:
    """What the rays of a sweep meet.

    Attributes:
        distance: (B, A) horizontal distance to the first surface [m]; infinite where there is none.
        piece: (B, A) piece met, NOTHING for the ground or the sky.
    """

    distance: Float32
    piece: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Windows:
    """The part of the range image that each piece can touch; a piece across the seam has two.

    Attributes:
        piece: (W,) which piece, nearest first.
        rows, columns: (W, 2) first and one past the last.
        near: (W,) least horizontal distance of the piece [m].
        n_columns: columns of the whole image.
    """

    piece: Int
    rows: Int
    columns: Int
    near: Float32
    n_columns: int

    @property
    def area(self) -> Int:
        """(W,) rays in each."""
        rays: Int = np.diff(self.rows, axis=1)[:, 0] * np.diff(self.columns, axis=1)[:, 0]
        return rays


@dataclass(frozen=True, slots=True)
class Form:
    """What bounds a piece, and where rays cross it.

    Attributes:
        code: 1 for a box, plus 2 for a quadric, plus 4 for foliage, plus 8 times the number of cutting planes.
    """

    code: int

    @classmethod
    def codes(cls, pieces: Pieces) -> Int:
        """(n,) code of each piece."""
        rounded = (pieces.quadric > 0).any(axis=1)
        boxed = (pieces.quadric * np.square(pieces.half) < np.float32(0.999)).any(axis=1)
        cut = pieces.cuts[:, :, :3].any(axis=2).sum(axis=1)
        codes: Int = boxed + 2 * rounded + 4 * np.isfinite(pieces.density) + 8 * cut
        return codes

    @property
    def foliage(self) -> bool:
        """Rays end somewhere inside."""
        return bool(self.code & 4)

    @property
    def cuts(self) -> int:
        """Cutting planes."""
        return self.code >> 3

    def cross(
        self,
        direction: list[Float32],
        start: list[Float32],
        half: Float32,
        quadric: Float32,
        cuts: Iterable[Float32],
    ) -> tuple[Float32, Float32]:
        """Where rays enter and leave a piece [m, horizontal]; a ray that misses does not enter before it leaves.

        Args:
            direction: of the rays, three components in the piece's own frame, of shapes that broadcast.
            start: of the rays, likewise.
            half: sides of the piece, or of each ray's piece, by axis.
            quadric: likewise.
            cuts: cutting planes, likewise.
        """
        enter: Float32 = np.full(1, -np.inf, np.float32)
        leave: Float32 = -enter
        middle: NDArray[Any]
        if self.code & 1:
            for i in range(3):
                inverse = 1 / direction[i]
                middle, reach = start[i] * -inverse, half[i] * np.abs(inverse)
                enter, leave = np.maximum(enter, middle - reach), np.minimum(leave, middle + reach)
        if self.code & 2:
            a = _sum(quadric[i] * direction[i] * direction[i] for i in range(3))
            middle = -_sum(quadric[i] * direction[i] * start[i] for i in range(3)) / a
            # Squared distance of the ray's nearest point: float32 holds it where b^2 - ac would cancel.
            outside: Float32 = _sum(quadric[i] * np.square(start[i] + middle * direction[i]) for i in range(3))
            reach = np.sqrt((1 - outside) / a)  # not a number, hence no hit, where the ray misses
            enter, leave = np.maximum(enter, middle - reach), np.minimum(leave, middle + reach)
        for cut, _ in zip(cuts, range(self.cuts), strict=False):
            slope = cut[0] * direction[0] + cut[1] * direction[1] + cut[2] * direction[2]
            at = (cut[3] - (cut[0] * start[0] + cut[1] * start[1] + cut[2] * start[2])) / slope
            enter = np.where(slope < 0, np.maximum(enter, at), enter)
            leave = np.where(slope > 0, np.minimum(leave, at), leave)
        return enter, leave


def _sum(terms: Iterable[Float32]) -> Float32:
    return reduce(np.add, terms)


class _Columns:
    """Pieces by component, each contiguous, so that what a ray needs is gathered fast."""

    def __init__(self, pieces: Pieces) -> None:
        self.rotation: Float32 = np.ascontiguousarray(pieces.rotation.transpose(1, 2, 0))
        self.shift: Float32 = np.ascontiguousarray(-np.einsum("nji,nj->in", pieces.rotation, pieces.centre))
        self.half: Float32 = np.ascontiguousarray(pieces.half.T)
        self.quadric: Float32 = np.ascontiguousarray(pieces.quadric.T)


class RayCaster:
    """Casts the rays of one sensor.

    A ray is a point (0, 0, origin) and a direction (cos azimuth, sin azimuth, tangent): its parameter is the
    horizontal distance. Each piece is met only by the rays of the window that it subtends.

    Args:
        sensor: the beams.
        batch_rays: windows of at most so many rays are cast together.
    """

    def __init__(self, sensor: SensorModel, batch_rays: int = BATCH_RAYS) -> None:
        self.sensor, self.batch_rays = sensor, batch_rays
        self.cos = np.cos(sensor.azimuth_rad).astype(np.float32)
        self.sin = np.sin(sensor.azimuth_rad).astype(np.float32)
        self.tangent = sensor.tangent[:, None]
        self.origin = sensor.origin_m.astype(np.float32)[:, None]

    def cast(self, pieces: Pieces, ground: Float32, depth: Float32) -> RangeImage:
        """The first surface that each ray meets.

        Large windows are cast one by one, nearest first, so that what is hidden is skipped; the many small ones
        are cast together, ray by ray.

        Args:
            pieces: in the sensor frame.
            ground: (B, A) horizontal distance to the ground [m], infinite where a ray misses it.
            depth: (B, A) optical depth at which each ray ends in foliage, exponentially distributed.
        """
        image = RangeImage(ground.copy(), np.full(ground.shape, NOTHING, np.int32))
        windows = self.windows(pieces)
        large = windows.area > self.batch_rays
        codes = Form.codes(pieces)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for w in np.flatnonzero(large).tolist():
                self._cast_window(pieces, Form(int(codes[windows.piece[w]])), windows, w, depth, image)
            self._cast_rays(pieces, codes, windows, np.flatnonzero(~large), depth, image)
        return image

    def _cast_window(
        self, pieces: Pieces, form: Form, windows: Windows, w: int, depth: Float32, image: RangeImage
    ) -> None:
        k, rows, columns = int(windows.piece[w]), slice(*windows.rows[w]), slice(*windows.columns[w])
        seen = image.distance[rows, columns]
        if windows.near[w] > seen.max():
            return
        R = pieces.rotation[k]
        across = R[0][:, None] * self.cos[columns] + R[1][:, None] * self.sin[columns]
        direction = [across[i] + R[2, i] * self.tangent[rows] for i in range(3)]
        start = [R[2, i] * self.origin[rows] - pieces.centre[k] @ R[:, i] for i in range(3)]
        enter, leave = form.cross(direction, start, pieces.half[k], pieces.quadric[k], pieces.cuts[k])
        if form.foliage:
            enter = np.maximum(enter, NEAREST_M) + depth[rows, columns] / pieces.density[k]
        hit = (enter < leave) & (enter < seen) & (enter > NEAREST_M)
        np.copyto(seen, enter, where=hit)
        np.copyto(image.piece[rows, columns], k, where=hit)

    def _cast_rays(
        self, pieces: Pieces, codes: Int, windows: Windows, which: Int, depth: Float32, image: RangeImage
    ) -> None:
        """Cast windows by form, as many at a time as the cache holds."""
        table = _Columns(pieces)
        form_of, area = codes[windows.piece[which]], windows.area[which]
        for form in np.unique(form_of).tolist():
            mine = form_of == form
            group = which[mine]
            part = np.cumsum(area[mine]) // CHUNK_RAYS
            for chunk in np.split(group, np.flatnonzero(np.diff(part)) + 1):
                self._cast_chunk(pieces, table, Form(form), windows, chunk, depth, image)

    def _cast_chunk(
        self,
        pieces: Pieces,
        table: _Columns,
        form: Form,
        windows: Windows,
        chunk: Int,
        depth: Float32,
        image: RangeImage,
    ) -> None:
        nearest, met = image.distance.reshape(-1), image.piece.reshape(-1)
        ray, row, column, k = self._pairs(windows, chunk, nearest)
        cos, sin, tangent, origin = self.cos[column], self.sin[column], self.tangent[row, 0], self.origin[row, 0]
        R = table.rotation
        up = [R[2][i][k] for i in range(3)]
        direction = [R[0][i][k] * cos + R[1][i][k] * sin + up[i] * tangent for i in range(3)]
        start = [up[i] * origin + table.shift[i][k] for i in range(3)]
        cuts = pieces.cuts[k].transpose(1, 2, 0) if form.cuts else ()
        enter, leave = form.cross(direction, start, table.half[:, k], table.quadric[:, k], cuts)
        if form.foliage:
            enter = np.maximum(enter, NEAREST_M) + depth.reshape(-1)[ray] / pieces.density[k]
        hit = np.flatnonzero((enter < leave) & (enter > NEAREST_M) & (enter < nearest[ray]))
        at, enter = ray[hit], enter[hit]
        np.minimum.at(nearest, at, enter)
        first = np.flatnonzero(enter == nearest[at])
        met[at[first]] = k[hit[first]]

    @staticmethod
    def _pairs(windows: Windows, chunk: Int, nearest: Float32) -> tuple[Int, Int, Int, Int]:
        """Ray, row, column and piece of everything in some windows that is not behind what is known already."""
        area, n_columns = windows.area[chunk], np.diff(windows.columns[chunk], axis=1)[:, 0]
        which = np.repeat(np.arange(len(chunk)), area)
        step = np.arange(len(which)) - (np.cumsum(area) - area)[which]
        down = step // n_columns[which]
        row = windows.rows[chunk, 0][which] + down
        column = windows.columns[chunk, 0][which] + step - down * n_columns[which]
        ray = row * windows.n_columns + column
        open_ = np.flatnonzero(windows.near[chunk][which] < nearest[ray])
        return ray[open_], row[open_], column[open_], windows.piece[chunk][which[open_]]

    def windows(self, pieces: Pieces) -> Windows:
        """The window of each piece that lies within the sensor's reach and field of view."""
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], np.float32)
        arm = (signs * pieces.half[:, None]) @ pieces.rotation.transpose(0, 2, 1)
        corner = (pieces.centre[:, None] + arm).astype(np.float32, copy=False)
        far = np.hypot(corner[..., 0], corner[..., 1]).max(axis=1)
        near = self._nearest(pieces)
        azimuth = np.arctan2(pieces.centre[:, 1], pieces.centre[:, 0]).astype(np.float64)
        c, s = np.cos(azimuth)[:, None], np.sin(azimuth)[:, None]
        x = c * corner[..., 0] + s * corner[..., 1]
        y = c * corner[..., 1] - s * corner[..., 0]
        off = np.arctan2(y, x)
        low, high = azimuth + off.min(axis=1), azimuth + off.max(axis=1)
        around = near < NEAREST_M
        low[around], high[around] = azimuth[around] - np.pi, azimuth[around] + np.pi
        bottom, top = corner[..., 2].min(axis=1), corner[..., 2].max(axis=1)
        inside = near < self.sensor.max_range_m
        r0, r1 = self._row_range(bottom, top, np.maximum(near, NEAREST_M), far)
        parts = []
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            c0 = np.searchsorted(self.sensor.azimuth_rad, low + turn)
            c1 = np.searchsorted(self.sensor.azimuth_rad, high + turn)
            which = np.flatnonzero(inside & (c1 > c0) & (r1 > r0))
            parts.append(np.stack([which, r0[which], r1[which], c0[which], c1[which]], axis=1))
        part = np.concatenate(parts)
        part = part[np.argsort(near[part[:, 0]], kind="stable")]
        return Windows(part[:, 0], part[:, 1:3], part[:, 3:5], near[part[:, 0]], self.sensor.shape[1])

    def _row_range(self, bottom: Float32, top: Float32, near: Float32, far: Float32) -> tuple[Int, Int]:
        """Rows whose beams can pass between two heights at those distances."""
        lowest, highest = self.origin.min(), self.origin.max()
        rise, fall = top - lowest, bottom - highest
        steepest = np.where(rise > 0, rise / near, rise / far)
        deepest = np.where(fall < 0, fall / near, fall / far)
        falling = -self.tangent[:, 0]
        return np.searchsorted(falling, -steepest), np.searchsorted(falling, -deepest, side="right")

    def _nearest(self, pieces: Pieces) -> Float32:
        """(n,) least horizontal distance, a lower bound where a piece is tilted."""
        upright: Bool = np.abs(pieces.rotation[:, 2, 2]) > 0.99
        R = pieces.rotation
        u = np.abs(np.einsum("nji,nj->ni", R[:, :2, :2], pieces.centre[:, :2]))
        gap = np.maximum(u - pieces.half[:, :2] - 0.15 * pieces.half[:, 2:], 0)
        exact = np.hypot(gap[:, 0], gap[:, 1])
        radius = np.linalg.norm(pieces.half, axis=1)
        loose = np.maximum(np.hypot(pieces.centre[:, 0], pieces.centre[:, 1]) - radius, 0)
        nearest: Float32 = np.where(upright, exact, loose).astype(np.float32)
        return nearest
