"""Lines of sight: which sides of a proposal something nearer or its own surface bounds, and what is hidden.

A proposal ends to the left and to the right where the object ends, or where something nearer hides the rest of it,
or where the same surface goes on without it. In the latter cases the end is *bounded*: it may move while the object
rests.
The nearest return is kept for each direction of a coarse grid of bearings and slopes.
"""

from __future__ import annotations

import ctypes

import numpy as np

from modt.geometry import pseudo_angle
from modt.geometry.kernels import GeometryKernels
from modt.native.declarations import declare
from modt.tracking.tuning import SightTuning
from modt.types import OBSTACLES, Bool, Float32, Float64, Int, Int8, PointKind, Proposals

BEARINGS = 720
"""Bearings of the grid, of equal pseudo-angle."""
SLOPES = 32
"""Slopes of the grid, which are tangents of elevations, from LEAST_SLOPE on."""
LEAST_SLOPE = np.float32(-0.6)
PER_SLOPE = np.float32(25.0)
"""Slopes of the grid in a unit of slope."""
BESIDE = 2
"""Bearings beside a proposal that are looked at."""
LOW_SHARE = 0.25
"""Lowest part of a proposal whose slopes are not looked at, since the ground is near there."""
BLOCKS_SIGHT = np.isin(np.arange(-128, 128), [PointKind.MEMBER, *OBSTACLES])
"""(256,) whether a point of each kind, from -128 on, hides what is behind it."""


class Sight:
    """Finds bounded ends and hidden places: the reference in NumPy.

    Args:
        tuning: points that are looked at, and distance beyond which an end is free.
    """

    def __init__(self, tuning: SightTuning = SightTuning()) -> None:
        self.tuning = tuning

    def look(self, points: Float32, kind: Int8) -> Float32:
        """(BEARINGS, SLOPES) horizontal distance of the nearest return that blocks the sight [m], else infinity.

        Args:
            points: (N, 4) points of a frame, sensor frame.
            kind: (N,) what each point is.
        """
        every = max(1, len(points) // self.tuning.rays) | 1  # odd, since beams may take turns in an even number
        nearest = np.empty((BEARINGS, SLOPES), np.float32)
        self._look(points, kind, every, nearest)
        return nearest

    def bounded_sides(self, nearest: Float32, proposals: Proposals, which: Int) -> Bool:
        """(R, 2) whether proposals `which` (R,) are bounded clockwise, and counter-clockwise.

        Args:
            nearest: result of `look` for the frame.
            proposals: proposals of the frame.
            which: (R,) proposals that are looked at.
        """
        margin_m = np.float32(self.tuning.margin_m)
        sides = np.zeros((len(which), 2), np.bool_)
        for i, proposal in enumerate(which.tolist()):
            members = slice(*proposals.offsets[proposal : proposal + 2].tolist())
            x, y, _ = proposals.coordinates[:, members]
            low, high = _slopes(proposals.box[proposal])
            bearing = _bearing(x, y)
            range_m = np.sqrt(x * x + y * y)
            centre = int(_bearing(*proposals.centroid[proposal, :2].astype(np.float32)[:, None])[0])
            # Bearings from the centre, from -BEARINGS / 2 on, so that nothing wraps within a proposal.
            off = (bearing - centre + 3 * BEARINGS // 2) % BEARINGS - BEARINGS // 2
            for side, sign in enumerate((-1, 1)):
                outermost = (sign * off).max()
                end_m = range_m[sign * off == outermost].min()
                beside = (centre + sign * (outermost + np.arange(1, BESIDE + 1))) % BEARINGS
                sides[i, side] = nearest[beside, low:high].min() < end_m + margin_m
        return sides

    def hides(self, nearest: Float32, box: Float64) -> Bool:
        """(R,) whether something nearer hides at least half of the bearings at which objects are expected.

        The number of bearings is approximate, since it takes them as equal angles.

        Args:
            nearest: result of `look` for the frame.
            box: (R, 7) boxes where the objects are expected, sensor frame. The shorter side is taken for the width.
        """
        range_m = np.hypot(box[:, 0], box[:, 1])
        half_m = box[:, 3:5].min(axis=1) / 2
        reach = (half_m / np.maximum(range_m, half_m) * BEARINGS / (2 * np.pi)).astype(np.int64)
        centre = _bearing(*box[:, :2].T.astype(np.float32))
        hides = np.zeros(len(box), np.bool_)
        for i, expected in enumerate(box):
            low, high = _slopes(expected)
            bearings = (centre[i] + np.arange(-reach[i], reach[i] + 1)) % BEARINGS
            nearer = nearest[bearings, low:high].min(axis=1) < range_m[i] - self.tuning.margin_m
            hides[i] = nearer.mean() >= 0.5
        return hides

    def _look(self, points: Float32, kind: Int8, every: int, nearest: Float32) -> None:
        """Fill the grid `nearest`, looking at one of `every` points."""
        blocks = BLOCKS_SIGHT[kind[::every].astype(np.int64) + 128]
        x, y, z = np.ascontiguousarray(points[::every][blocks, :3].T)
        range_m = np.maximum(np.sqrt(x * x + y * y), np.float32(1e-3))
        slope = np.floor((z / range_m - LEAST_SLOPE) * PER_SLOPE)
        inside = ((slope >= 0) & (slope < SLOPES)).nonzero()[0]
        at = _bearing(x[inside], y[inside]), slope[inside].astype(np.int64)
        nearest[:] = np.inf
        np.minimum.at(nearest, at, range_m[inside])


def _bearing(x: Float32, y: Float32) -> Int:
    """(n,) bearing of the grid."""
    bearing = (pseudo_angle(x, y) * np.float32(BEARINGS / 4)).astype(np.int64)
    return np.minimum(bearing, BEARINGS - 1)


def _slopes(box: Float64) -> tuple[int, int]:
    """First slope of the grid in which a box is seen, and the slope after the last."""
    range_m = max(float(np.sqrt(box[0] * box[0] + box[1] * box[1])), 1e-3)
    bottom_m = box[2] - box[5] / 2
    low = ((bottom_m + LOW_SHARE * box[5]) / range_m - float(LEAST_SLOPE)) * float(PER_SLOPE)
    high = ((bottom_m + box[5]) / range_m - float(LEAST_SLOPE)) * float(PER_SLOPE)
    return int(min(max(low, 0.0), SLOPES - 1)), int(min(max(high, 0.0), SLOPES - 1)) + 1


class NativeSight(Sight):
    """`Sight` in C (`modt.native`)."""

    def __init__(self, library: ctypes.CDLL, tuning: SightTuning) -> None:
        super().__init__(tuning)
        declare(library, "sight.c")
        self._library = library

    def bounded_sides(self, nearest: Float32, proposals: Proposals, which: Int) -> Bool:
        """(R, 2) the same."""
        sides = np.empty((len(which), 2), np.bool_)
        self._library.modt_bounded_sides(
            nearest,
            proposals.coordinates,
            proposals.coordinates.shape[1],
            proposals.offsets,
            proposals.box,
            proposals.centroid,
            which,
            len(which),
            self.tuning.margin_m,
            sides,
        )
        return sides

    def _look(self, points: Float32, kind: Int8, every: int, nearest: Float32) -> None:
        """The same."""
        self._library.modt_look(points, kind, len(points), every, nearest)


def sight_of(kernels: GeometryKernels, tuning: SightTuning) -> Sight:
    """Lines of sight: native if the kernels have a library, else in NumPy."""
    return Sight(tuning) if kernels.library is None else NativeSight(kernels.library, tuning)
