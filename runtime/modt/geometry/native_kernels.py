"""The passes of geometry in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from array import array

import numpy as np

from modt.geometry.kdop import AGREE_M, DECAY, DISAGREEMENT, HALF_ROOT, JITTER_M, PAD_M, PairWeights, Shapes
from modt.geometry.kernels import GeometryKernels
from modt.native.library import FLOAT32, FLOAT64, INT64, Own, Signatures, declare, pointers, structure
from modt.types import Float32, Float64, Int

_D, _L = ctypes.c_double, ctypes.c_int64
_SIGNATURES: Signatures = {
    "modt_upright_boxes": (None, (*[FLOAT32] * 3, INT64, _L, FLOAT64, Own, Own, _D, Own)),
    "modt_kdop_ends": (None, (*[FLOAT32] * 3, INT64, _L, FLOAT32, Own)),
    "modt_group_sums": (None, (FLOAT32, _L, _L, INT64, _L, Own)),
    "modt_copy_runs": (None, (Own, INT64, INT64, _L, Own)),
    "modt_overlapping_pairs": (_L, (FLOAT64, _L, FLOAT64, _L, Own, _L, Own, Own)),
    "modt_coverage": (None, (FLOAT64, _L, FLOAT64, _L, INT64, INT64, _L, _D, Own)),
    "modt_measured": (None, (FLOAT64, FLOAT64, _L, _D, FLOAT64, Own, _D, Own, Own, Own)),
    "modt_pair_costs": (None, (Own, Own, FLOAT64, _D, INT64, INT64, _L, Own, _D, _D, Own, Own, Own)),
    "modt_certain_pairs": (None, (INT64, INT64, FLOAT64, _L, _D, Own, Own, Own, _L, Own)),
    "modt_settle_pairs": (ctypes.c_int, (INT64, INT64, FLOAT64, _L, _D, Own, _L, Own, Own, Own, Own)),
    "modt_regrouped": (None, (Own, INT64, _L, INT64, INT64, INT64, _L, _L, Own, Own, Own)),
}
_PAIRS_EACH = 8
"""Pairs that there is room for at first, of each k-DOP."""


class NativeGeometryKernels(GeometryKernels):
    """The passes in C.

    Args:
        library: the compiled library (`modt.native.library`).
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        declare(library, _SIGNATURES)
        self.library: ctypes.CDLL = library

    def upright_boxes(self, xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
        """(G, 7) boxes at (G,) headings, or across them, about groups of (3, K) points."""
        box = np.empty((len(yaw), 7))
        self.library.modt_upright_boxes(*xyz, offsets, len(yaw), yaw, np.cos(yaw), np.sin(yaw), np.pi / 2, box)
        return box

    def kdop_ends(self, xyz: Float32, offsets: Int, axes: Float32) -> Float32:
        """(8, G) greatest coordinates of each group along (3, 4) axes, then against them, given (3, K) points."""
        n = len(offsets) - 1
        ends = np.empty((8, n), np.float32)
        self.library.modt_kdop_ends(*xyz, offsets, n, axes, ends)
        return ends

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        sums = np.empty((len(values), len(offsets) - 1), np.float64)
        self.library.modt_group_sums(values, *values.shape, offsets, sums.shape[1], sums)
        return sums

    def copy_runs(self, members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
        """Members and (3, ...) coordinates of (2, R) runs of them, one after the other."""
        (begin, end), n = runs, int((runs[1] - runs[0]).sum())
        rows, xyz = np.empty(n, np.int64), np.empty((3, n), np.float32)
        given, out = pointers(members, coordinates), pointers(rows, xyz)
        self.library.modt_copy_runs(given, begin, end, len(begin), out)
        return rows, xyz

    def overlapping_pairs(self, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y."""
        a, b, n, k = np.ascontiguousarray(a), np.ascontiguousarray(b), a.shape[1], b.shape[1]
        least, limit = np.empty(4 * (k + 15)), _PAIRS_EACH * (n + k)
        while True:
            one, other = np.empty((2, limit), np.int64)
            count = self.library.modt_overlapping_pairs(a, n, b, k, least, limit, one, other)
            if count <= limit:
                return one[:count], other[:count]
            limit = count

    def coverage(self, a: Float64, b: Float64, rows: Int, columns: Int) -> Float64:
        """(K,) part of the k-DOP of a (8, n) that that of b (8, k) covers, of each pair."""
        a, b, part = np.ascontiguousarray(a), np.ascontiguousarray(b), np.empty(len(rows))
        self.library.modt_coverage(a, a.shape[1], b, b.shape[1], rows, columns, len(rows), JITTER_M, part)
        return part

    def measured(self, a: Float64, b: Float64, variance: float, before: Float64) -> tuple[Float64, Float64, Float64]:
        """Displacement between k-DOPs a and b (8, K) with its covariance, and the variance by ends that disagree."""
        n, limits = a.shape[1], array("d", (AGREE_M, DISAGREEMENT**2, DECAY))
        out = np.empty((n, 2)), np.empty((n, 2, 2)), np.empty((4, n))
        self.library.modt_measured(a, b, n, variance, before, limits, HALF_ROOT, *out)
        return out

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
        n, weighted = len(pairs[0]), array("d", weights)
        spread, cost, coverage = np.empty((3, n))
        tracks, proposals = (structure(s.kdop, s.log_width, s.bottom, s.top, s.log_count, len(s)) for s in (a, b))
        given = tracks, proposals, covariance, variance, *pairs, n, weighted, HALF_ROOT, PAD_M
        self.library.modt_pair_costs(*given, spread, cost, coverage)
        return cost + np.log(spread) / 2, coverage

    def assign(self, rows: Int, columns: Int, cost: Float64, limit: float) -> Int:
        """Indices, ascending, of the candidate pairs that a least-cost assignment keeps."""
        n, sizes = len(rows), array("q", (int(rows.max(initial=-1)) + 1, int(columns.max(initial=-1)) + 1))
        most, given, state = max(sizes), (rows, columns, cost, n, limit), np.empty(n, np.uint8)
        number = np.empty((2, most), np.int64)
        self.library.modt_certain_pairs(*given, sizes, number, np.empty((2, most)), most, state)
        if sizes[0]:
            few, many = sorted(sizes)
            costs, partners = np.empty(few * many + few + 2 * many), np.empty(few + 3 * many, np.int64)
            if not self.library.modt_settle_pairs(*given, number, most, sizes, costs, partners, state):
                raise ValueError("no assignment has a finite cost")
        return state.nonzero()[0]

    def regrouped(
        self, members: Int, coordinates: Float32, offsets: Int, label: Int, moved: tuple[Int, Int], n: int
    ) -> tuple[Int, Float32, Int]:
        """Members and (3, K) coordinates by the label of their group or, if moved, their own; (n,) count of each."""
        rows, xyz, (following, count) = np.empty_like(members), np.empty_like(coordinates), np.empty((2, n), np.int64)
        given, out = pointers(members, coordinates), pointers(rows, xyz)
        groups = offsets, len(label), label, *moved, len(moved[0]), n
        self.library.modt_regrouped(given, *groups, following, count, out)
        return rows, xyz, count
