"""The passes of geometry in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from array import array

import numpy as np

from modt.geometry.kdop_pairs import HALF_ROOT, PAD_M, PairWeights, Shapes
from modt.native.arrays import FLOAT64, INT64, Signatures, address, at, declare, pointers
from modt.types import Float32, Float64, Int

_D, _L, _P = ctypes.c_double, ctypes.c_int64, ctypes.c_void_p
_SIGNATURES: Signatures = {
    "modt_ends_along": (None, (_P, _P, _P, _P, _L, _P, _L, _P, _P)),
    "modt_overlapping_pairs": (_L, (_P, _L, _P, _L, _P, _L, _P, _P)),
    "modt_pair_costs": (None, (_P, _P, _P, _D, _P, _P, _L, _P, _D, _D, _P, _P, _P)),
    "modt_certain_pairs": (None, (_P, _P, _L, _D, _P, _P, _P, _P)),
}
_PAIRS_EACH = 8
"""Pairs that there is room for at first, of each k-DOP."""


class NativeGeometryKernels:
    """The passes in C.

    Args:
        library: that of `modt.native.library`.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        declare(library, _SIGNATURES)
        self._library = library

    def bounds_along(self, xyz: Float32, offsets: Int, cosine: Float32, sine: Float32) -> tuple[Float32, Float32]:
        """(3, G) least and greatest coordinates of each group along its axes, given (3, K) points."""
        axes = np.zeros((len(cosine), 3, 4), np.float32)
        axes[:, 0, 0] = axes[:, 1, 1] = cosine
        axes[:, 1, 0], axes[:, 2, 2] = sine, 1.0
        np.negative(sine, out=axes[:, 0, 1])
        ahead, behind = self._ends_along(xyz, offsets, axes, 12)
        return behind.T[:3], ahead.T[:3]

    def kdop_ends(self, xyz: Float32, offsets: Int, axes: Float32) -> Float32:
        """(8, G) greatest coordinates of each group along (3, 4) axes, then against them, given (3, K) points."""
        ahead, behind = self._ends_along(xyz, offsets, axes, 0)
        ends = np.empty((8, len(ahead)), np.float32)
        ends[:4] = ahead.T
        np.negative(behind.T, out=ends[4:])
        return ends

    def _ends_along(self, xyz: Float32, offsets: Int, axes: Float32, stride: int) -> tuple[Float32, Float32]:
        """(G, 4) greatest and (G, 4) least coordinates along four axes, those of a group `stride` numbers on."""
        n = len(offsets) - 1
        ahead, behind = np.empty((2, n, 4), np.float32)
        given = *map(at, xyz), at(offsets, INT64), n, at(axes), stride
        self._library.modt_ends_along(*given, at(ahead), at(behind))
        return ahead, behind

    def overlapping_pairs(self, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y."""
        n, k = a.shape[1], b.shape[1]
        fours, limit = np.empty(4 * (k + 15)), _PAIRS_EACH * (n + k)
        given = at(a, FLOAT64), n, at(b, FLOAT64), k, address(fours)
        while True:
            one, other = np.empty((2, limit), np.int64)
            count = self._library.modt_overlapping_pairs(*given, limit, address(one), address(other))
            if count <= limit:
                return one[:count], other[:count]
            limit = count

    def pair_costs(
        self,
        a: Shapes,
        b: Shapes,
        covariance: Float64,
        variance: float,
        pairs: tuple[Int, Int],
        weights: PairWeights,
    ) -> tuple[Float64, Float64]:
        """(K,) cost and coverage of pairs of shapes."""
        rows, columns = pairs
        spread, cost, coverage = out = np.empty((3, len(rows)))
        tracks, proposals, weighted = self._shapes(a), self._shapes(b), array("d", weights)
        self._library.modt_pair_costs(
            address(tracks), address(proposals), at(covariance, FLOAT64), variance,
            at(rows, INT64), at(columns, INT64), len(rows), address(weighted), HALF_ROOT, PAD_M,
            *map(address, out),
        )  # fmt: skip
        return cost + np.log(spread) / 2, coverage

    def certain_pairs(self, rows: Int, columns: Int, cost: Float64, limit: float) -> tuple[Int, Int]:
        """Pairs that a least-cost assignment keeps for certain, and those that it must decide among."""
        sizes = np.array([rows.max(initial=-1), columns.max(initial=-1)]) + 1
        n, most = len(rows), int(sizes.max())
        best, following, state = np.empty((2, most), np.int64), np.empty((2, most)), np.empty(n, np.uint8)
        index, scratch = array("Q", (at(rows, INT64), at(columns, INT64))), (pointers(best), pointers(following))
        self._library.modt_certain_pairs(
            address(index), at(cost, FLOAT64), n, limit, address(sizes), *map(address, scratch), address(state)
        )
        return (state == 1).nonzero()[0], (state == 2).nonzero()[0]

    @staticmethod
    def _shapes(shapes: Shapes) -> array[int]:
        columns = shapes.kdop, shapes.log_width, shapes.bottom, shapes.top, shapes.log_count
        return array("Q", (*(at(column, FLOAT64) for column in columns), len(shapes)))
