"""The passes of geometry in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from array import array

import numpy as np

from modt.geometry.kdop import HALF_ROOT, PAD_M, PairWeights, Shapes
from modt.geometry.kernels import GeometryKernels
from modt.native.library import FLOAT64, INT64, Signatures, address, at, declare, pointers
from modt.types import Bool, Float32, Float64, Int

_D, _L, _P = ctypes.c_double, ctypes.c_int64, ctypes.c_void_p
_SIGNATURES: Signatures = {
    "modt_upright_boxes": (None, (_P, _P, _P, _P, _L, _P, _P, _P, _D, _P)),
    "modt_kdop_ends": (None, (_P, _P, _P, _P, _L, _P, _P)),
    "modt_group_sums": (None, (_P, _L, _L, _P, _L, _P)),
    "modt_copy_runs": (None, (_P, _P, _P, _L, _P)),
    "modt_overlapping_pairs": (_L, (_P, _L, _P, _L, _P, _L, _P, _P)),
    "modt_pair_costs": (None, (_P, _P, _P, _D, _P, _P, _L, _P, _D, _D, _P, _P, _P)),
    "modt_least_cost_assignment": (ctypes.c_int, (_P, _L, _L, _P)),
    "modt_certain_pairs": (None, (_P, _P, _L, _D, _P, _P, _P, _P)),
}
_PAIRS_EACH = 8
"""Pairs that there is room for at first, of each k-DOP."""


class NativeGeometryKernels(GeometryKernels):
    """The passes in C.

    Args:
        library: that of `modt.native.library`.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        declare(library, _SIGNATURES)
        self._library = library

    def upright_boxes(self, xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
        """(G, 7) boxes at (G,) headings, or across them, about groups of (3, K) points."""
        box, cosine, sine = np.empty((len(yaw), 7)), np.cos(yaw), np.sin(yaw)
        headings = at(yaw, FLOAT64), address(cosine), address(sine)
        given = *map(at, xyz), at(offsets, INT64), len(yaw)
        self._library.modt_upright_boxes(*given, *headings, np.pi / 2, address(box))
        return box

    def kdop_ends(self, xyz: Float32, offsets: Int, axes: Float32) -> Float32:
        """(8, G) greatest coordinates of each group along (3, 4) axes, then against them, given (3, K) points."""
        n = len(offsets) - 1
        ends = np.empty((8, n), np.float32)
        self._library.modt_kdop_ends(*map(at, xyz), at(offsets, INT64), n, at(axes), address(ends))
        return ends

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        sums = np.empty((len(values), len(offsets) - 1), np.float64)
        given = at(values), *values.shape, at(offsets, INT64), sums.shape[1]
        self._library.modt_group_sums(*given, at(sums, FLOAT64))
        return sums

    def copy_runs(self, members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
        """Members and (3, ...) coordinates of (2, R) runs of them, one after the other."""
        (begin, end), n = runs, int((runs[1] - runs[0]).sum())
        rows, xyz = np.empty(n, np.int64), np.empty((3, n), np.float32)
        given, out = pointers(members, coordinates), pointers(rows, xyz)
        self._library.modt_copy_runs(address(given), at(begin, INT64), at(end, INT64), len(begin), address(out))
        return rows, xyz

    def overlapping_pairs(self, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y."""
        a, b, n, k = np.ascontiguousarray(a), np.ascontiguousarray(b), a.shape[1], b.shape[1]
        least, limit = np.empty(4 * (k + 15)), _PAIRS_EACH * (n + k)
        given = at(a, FLOAT64), n, at(b, FLOAT64), k, address(least)
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
        sizes = array("q", (int(rows.max(initial=-1)) + 1, int(columns.max(initial=-1)) + 1))
        n, most = len(rows), max(sizes)
        best, following, state = np.empty((2, most), np.int64), np.empty((2, most)), np.empty(n, np.uint8)
        index, scratch = array("Q", (at(rows, INT64), at(columns, INT64))), (pointers(best), pointers(following))
        self._library.modt_certain_pairs(
            address(index), at(cost, FLOAT64), n, limit, address(sizes), *map(address, scratch), address(state)
        )
        return (state == 1).nonzero()[0], (state == 2).nonzero()[0]

    def least_cost_assignment(self, cost: Float64) -> Bool:
        """(R, C) pairs of the assignment of least cost, one in each row or one in each column."""
        chosen = np.zeros(cost.shape, np.bool_)
        wide, pairs = (cost, chosen) if cost.shape[0] <= cost.shape[1] else (cost.T, chosen.T)
        n, k = wide.shape
        column_of = np.empty(n, np.int64)
        potentials, distance, (row_of, before, remaining) = np.empty(n), np.empty((2, k)), np.empty((3, k), np.int64)
        scratch = pointers(potentials, distance, column_of, row_of, before, remaining)
        dense = np.ascontiguousarray(wide)
        if not self._library.modt_least_cost_assignment(at(dense, FLOAT64), n, k, address(scratch)):
            raise ValueError("no assignment has a finite cost")
        pairs[np.arange(n), column_of] = True
        return chosen

    @staticmethod
    def _shapes(shapes: Shapes) -> array[int]:
        columns = shapes.kdop, shapes.log_width, shapes.bottom, shapes.top, shapes.log_count
        return array("Q", (*(at(column, FLOAT64) for column in columns), len(shapes)))
