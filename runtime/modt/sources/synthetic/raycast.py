"""Ray casting of convex pieces into a range image with a depth buffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.sources.synthetic.pieces import Pieces
from modt.sources.synthetic.sensors import SensorModel
from modt.types import Bool, Float32, Int

NOTHING = -1
"""Piece met by a ray that meets none."""

NEAREST_M = np.float32(0.05)


@dataclass(frozen=True, slots=True)
class RangeImage:
    """What the rays of a sweep meet.

    Attributes:
        distance: (B, A) horizontal distance to the first surface [m]; infinite where there is none.
        piece: (B, A) piece met, NOTHING for the ground or the sky.
    """

    distance: Float32
    piece: Int


@dataclass(frozen=True, slots=True)
class Windows:
    """The part of the range image that each piece can touch; a piece across the seam has two.

    Attributes:
        piece: (W,) which piece, nearest first.
        rows, columns: (W, 2) first and one past the last.
        near: (W,) least horizontal distance of the piece [m].
    """

    piece: Int
    rows: Int
    columns: Int
    near: Float32


class RayCaster:
    """Casts the rays of one sensor.

    A ray is a point (0, 0, origin) and a direction (cos azimuth, sin azimuth, tangent): its parameter is the
    horizontal distance. Each piece is met only by the rays of the window that it subtends.

    Args:
        sensor: the beams.
    """

    def __init__(self, sensor: SensorModel) -> None:
        self.sensor = sensor
        self.cos = np.cos(sensor.azimuth_rad).astype(np.float32)
        self.sin = np.sin(sensor.azimuth_rad).astype(np.float32)
        self.tangent = sensor.tangent[:, None]
        self.origin = sensor.origin_m.astype(np.float32)[:, None]

    def cast(self, pieces: Pieces, ground: Float32, depth: Float32) -> RangeImage:
        """The first surface that each ray meets.

        Args:
            pieces: in the sensor frame.
            ground: (B, A) horizontal distance to the ground [m], infinite where a ray misses it.
            depth: (B, A) optical depth at which each ray ends in foliage, exponentially distributed.
        """
        distance = ground.copy()
        piece = np.full(distance.shape, NOTHING, np.int64)
        windows = self.windows(pieces)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for k, (r0, r1), (c0, c1), near in zip(
                windows.piece.tolist(), windows.rows.tolist(), windows.columns.tolist(), windows.near, strict=True
            ):
                seen = distance[r0:r1, c0:c1]
                if near > seen.max():
                    continue
                enter, leave = self._cross(pieces, k, slice(r0, r1), slice(c0, c1))
                if np.isfinite(pieces.density[k]):
                    enter = np.maximum(enter, NEAREST_M) + depth[r0:r1, c0:c1] / pieces.density[k]
                hit = (enter < leave) & (enter < seen) & (enter > NEAREST_M)
                np.copyto(seen, enter, where=hit)
                np.copyto(piece[r0:r1, c0:c1], k, where=hit)
        return RangeImage(distance, piece)

    def _cross(self, pieces: Pieces, k: int, rows: slice, columns: slice) -> tuple[Float32, Float32]:
        """Where the rays of a window enter and leave one piece [m, horizontal]."""
        R = pieces.rotation[k]
        across = R[0][:, None] * self.cos[columns] + R[1][:, None] * self.sin[columns]
        direction = [across[i] + R[2, i] * self.tangent[rows] for i in range(3)]
        start = [R[2, i] * self.origin[rows] - pieces.centre[k] @ R[:, i] for i in range(3)]
        enter = np.float32(-np.inf) * np.ones(1, np.float32)
        leave = -enter
        quadric = pieces.quadric[k]
        for i in range(3):
            if quadric.all():
                break
            inverse = 1 / direction[i]
            middle, half = start[i] * -inverse, pieces.half[k, i] * np.abs(inverse)
            enter, leave = np.maximum(enter, middle - half), np.minimum(leave, middle + half)
        if quadric.any():
            a, b = 0.0, 0.0
            for i in np.flatnonzero(quadric):
                a = a + quadric[i] * direction[i] * direction[i]
                b = b + quadric[i] * direction[i] * start[i]
            middle = -b / a
            outside = 0.0  # squared distance of the ray's nearest point, which float32 holds where b^2 - ac would not
            for i in np.flatnonzero(quadric):
                nearest = start[i] + middle * direction[i]
                outside = outside + quadric[i] * nearest * nearest
            half = np.sqrt((1 - outside) / a)  # not a number, hence no hit, where the ray misses
            enter, leave = np.maximum(enter, middle - half), np.minimum(leave, middle + half)
        for cut in pieces.cuts[k]:
            if not cut[:3].any():
                break
            slope = cut[0] * direction[0] + cut[1] * direction[1] + cut[2] * direction[2]
            at = (cut[3] - (cut[0] * start[0] + cut[1] * start[1] + cut[2] * start[2])) / slope
            enter = np.where(slope < 0, np.maximum(enter, at), enter)
            leave = np.where(slope > 0, np.minimum(leave, at), leave)
        return enter, leave

    def windows(self, pieces: Pieces) -> Windows:
        """The window of each piece that lies within the sensor's reach and field of view."""
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], np.float32)
        arm = (signs * pieces.half[:, None]) @ pieces.rotation.transpose(0, 2, 1)
        corner = pieces.centre[:, None] + arm
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
        return Windows(part[:, 0], part[:, 1:3], part[:, 3:5], near[part[:, 0]])

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
