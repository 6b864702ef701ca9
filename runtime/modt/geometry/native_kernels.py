"""The passes of geometry in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from array import array

import numpy as np

from modt.geometry.kdop import END_PAD_M, HALF_ROOT, PAD_M, PairWeights, Shapes
from modt.geometry.kernels import GeometryKernels
from modt.native.library import FLOAT64, INT64, Signatures, address, at, declare, pointers
from modt.types import Float32, Float64, Int

_D, _L, _P = ctypes.c_double, ctypes.c_int64, ctypes.c_void_p
_SIGNATURES: Signatures = {
    "modt_upright_boxes": (None, (_P, _P, _P, _P, _L, _P, _P, _P, _D, _P)),
    "modt_kdop_ends": (None, (_P, _P, _P, _P, _L, _P, _P)),
    "modt_group_sums": (None, (_P, _L, _L, _P, _L, _P)),
    "modt_copy_runs": (None, (_P, _P, _P, _L, _P)),
    "modt_overlapping_pairs": (_L, (_P, _L, _P, _L, _P, _L, _P, _P)),
    "modt_pair_costs": (None, (_P, _P, _P, _D, _P, _P, _L, _P, _D, _D, _P, _P, _P)),
    "modt_coverages": (None, (_P, _P, _L, _P, _L, _P, _P, _L, _D, _P, _P)),
    "modt_certain_pairs": (None, (_P, _P, _L, _D, _P, _P, _P, _P)),
    "modt_settle_pairs": (ctypes.c_int, (_P, _P, _L, _D, _P, _P, _P, _P, _P)),
    "modt_regrouped": (None, (_P, _P, _P, _L, _L, _P, _P, _P)),
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
        self.library: ctypes.CDLL = library

    def upright_boxes(self, xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
        """(G, 7) boxes at (G,) headings, or across them, about groups of (3, K) points."""
        box, cosine, sine = np.empty((len(yaw), 7)), np.cos(yaw), np.sin(yaw)
        headings = at(yaw, FLOAT64), address(cosine), address(sine)
        given = *map(at, xyz), at(offsets, INT64), len(yaw)
        self.library.modt_upright_boxes(*given, *headings, np.pi / 2, address(box))
        return box

    def kdop_ends(self, xyz: Float32, offsets: Int, axes: Float32) -> Float32:
        """(8, G) greatest coordinates of each group along (3, 4) axes, then against them, given (3, K) points."""
        n = len(offsets) - 1
        ends = np.empty((8, n), np.float32)
        self.library.modt_kdop_ends(*map(at, xyz), at(offsets, INT64), n, at(axes), address(ends))
        return ends

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        sums = np.empty((len(values), len(offsets) - 1), np.float64)
        given = at(values), *values.shape, at(offsets, INT64), sums.shape[1]
        self.library.modt_group_sums(*given, at(sums, FLOAT64))
        return sums

    def copy_runs(self, members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
        """Members and (3, ...) coordinates of (2, R) runs of them, one after the other."""
        (begin, end), n = runs, int((runs[1] - runs[0]).sum())
        rows, xyz = np.empty(n, np.int64), np.empty((3, n), np.float32)
        given, out = pointers(members, coordinates), pointers(rows, xyz)
        self.library.modt_copy_runs(address(given), at(begin, INT64), at(end, INT64), len(begin), address(out))
        return rows, xyz

    def overlapping_pairs(self, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y."""
        a, b, n, k = np.ascontiguousarray(a), np.ascontiguousarray(b), a.shape[1], b.shape[1]
        least, limit = np.empty(4 * (k + 15)), _PAIRS_EACH * (n + k)
        given = at(a, FLOAT64), n, at(b, FLOAT64), k, address(least)
        while True:
            one, other = np.empty((2, limit), np.int64)
            count = self.library.modt_overlapping_pairs(*given, limit, address(one), address(other))
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
        self.library.modt_pair_costs(
            address(tracks), address(proposals), at(covariance, FLOAT64), variance,
            at(rows, INT64), at(columns, INT64), len(rows), address(weighted), HALF_ROOT, PAD_M,
            *map(address, out),
        )  # fmt: skip
        return cost + np.log(spread) / 2, coverage

    def covering_pairs(self, known: Float64, expected: Float64, seen: Float64) -> tuple[Int, Int, Float64, Float64]:
        """Pairs of known and seen k-DOPs that overlap, and (K,) how much of the seen and the expected is covered."""
        one, other = self.overlapping_pairs(known, seen)
        within, around = part = np.empty((2, len(one)))
        self.library.modt_coverages(
            at(known, FLOAT64), at(expected, FLOAT64), known.shape[1], at(seen, FLOAT64), seen.shape[1],
            at(one, INT64), at(other, INT64), len(one), END_PAD_M, *map(address, part),
        )  # fmt: skip
        return one, other, within, around

    def assign(self, rows: Int, columns: Int, cost: Float64, limit: float) -> Int:
        """Indices, ascending, of the candidate pairs that a least-cost assignment keeps."""
        n, sizes = len(rows), array("q", (int(rows.max(initial=-1)) + 1, int(columns.max(initial=-1)) + 1))
        number, following, state = (
            np.empty((2, max(sizes)), np.int64),
            np.empty((2, max(sizes))),
            np.empty(n, np.uint8),
        )
        index, numbers, scratch = (
            array("Q", (at(rows, INT64), at(columns, INT64))),
            pointers(number),
            pointers(following),
        )
        given, out = (address(index), at(cost, FLOAT64), n, limit), (address(numbers), address(sizes))
        self.library.modt_certain_pairs(*given, *out[::-1], address(scratch), address(state))
        if sizes[0]:
            few, many = sorted(sizes)
            potentials, distance, matrix = np.empty(few), np.empty((2, many)), np.empty(few * many)
            column_of, others = np.empty(few, np.int64), np.empty((3, many), np.int64)
            scratch = pointers(potentials, distance, column_of, others)
            if not self.library.modt_settle_pairs(*given, *out, address(matrix), address(scratch), address(state)):
                raise ValueError("no assignment has a finite cost")
        return state.nonzero()[0]

    def regrouped(
        self, members: Int, coordinates: Float32, piece: Int, number: Int, n: int
    ) -> tuple[Int, Float32, Int]:
        """Members and (3, K) coordinates in n groups, given the piece of each and the group of each piece."""
        rows, xyz, (following, count) = np.empty_like(members), np.empty_like(coordinates), np.empty((2, n), np.int64)
        given, out = pointers(members, coordinates), pointers(rows, xyz)
        self.library.modt_regrouped(
            address(given), at(piece, INT64), at(number, INT64), len(members), n, address(following), address(count),
            address(out),
        )  # fmt: skip
        return rows, xyz, count

    @staticmethod
    def _shapes(shapes: Shapes) -> array[int]:
        columns = shapes.kdop, shapes.log_width, shapes.bottom, shapes.top, shapes.log_count
        return array("Q", (*(at(column, FLOAT64) for column in columns), len(shapes)))
