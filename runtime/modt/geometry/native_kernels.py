"""The passes of geometry in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from array import array
from functools import lru_cache

import numpy as np
from numpy import float32, float64, int64

from modt.geometry.kdop import PairWeights, Shapes
from modt.geometry.kernels import GeometryKernels
from modt.geometry.tuning import ShapeTuning
from modt.native.declarations import declare, structure
from modt.types import Float32, Float64, Int

_TUNING = structure("ShapeTuning")
_WEIGHTS = structure("PairWeights")
_SHAPES = structure("Shapes")
_ASSIGNMENT = structure("Assignment")
_PAIRS_EACH = 8
"""Pairs that there is room for at first, of each k-DOP."""
_BLOCK = 16
"""k-DOPs that are compared together, BLOCK of geometry.c."""


class NativeGeometryKernels(GeometryKernels):
    """The passes in C.

    Args:
        library: the compiled library (`modt.native.library`).
        tuning: comparison of k-DOPs.
    """

    def __init__(self, library: ctypes.CDLL, tuning: ShapeTuning = ShapeTuning()) -> None:
        super().__init__(tuning)
        declare(library, "geometry.c", "groups.c", "assignment.c")
        self.library: ctypes.CDLL = library
        self._tuning = _TUNING.of(tuning)
        self._weights = lru_cache(_WEIGHTS.of)

    def upright_boxes(self, xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
        """(G, 7) boxes at (G,) headings, or across them, about groups of (3, K) points."""
        box = np.empty((len(yaw), 7))
        self.library.modt_upright_boxes(*xyz, offsets, len(yaw), yaw, np.cos(yaw), np.sin(yaw), box)
        return box

    def kdop_ends(self, xyz: Float32, offsets: Int, axes: Float32) -> Float32:
        """(8, G) greatest coordinates of each group along (3, 4) axes, then against them, given (3, K) points."""
        n = len(offsets) - 1
        ends = np.empty((8, n), float32)
        self.library.modt_kdop_ends(*xyz, offsets, n, axes, ends)
        return ends

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        sums = np.empty((len(values), len(offsets) - 1), float64)
        self.library.modt_group_sums(values, *values.shape, offsets, sums.shape[1], sums)
        return sums

    def copy_runs(self, members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
        """Members and (3, ...) coordinates of (2, R) runs of them, one after the other."""
        begin, end = runs
        n = int((end - begin).sum())
        copied_members = np.empty(n, int64)
        copied = np.empty((3, n), float32)
        self.library.modt_copy_runs(
            members, coordinates, len(members), begin, end, len(begin), copied_members, copied, n
        )  # fmt: skip
        return copied_members, copied

    def overlapping_pairs(self, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y."""
        a = np.ascontiguousarray(a)
        b = np.ascontiguousarray(b)
        n_a = a.shape[1]
        n_b = b.shape[1]
        n_blocks = -(-n_b // _BLOCK)
        reach = np.empty((n_blocks, 4, _BLOCK), float32)
        limit = _PAIRS_EACH * (n_a + n_b)
        while True:
            rows, columns = np.empty((2, limit), int64)
            count = self.library.modt_overlapping_pairs(a, n_a, b, n_b, reach, n_blocks, limit, rows, columns)
            if count <= limit:
                return rows[:count], columns[:count]
            limit = count

    def coverage(self, a: Float64, b: Float64, rows: Int, columns: Int) -> Float64:
        """(K,) share of each k-DOP of a (8, n) that one of b (8, k) covers."""
        a = np.ascontiguousarray(a)
        b = np.ascontiguousarray(b)
        share = np.empty(len(rows))
        self.library.modt_coverage(
            a, a.shape[1], b, b.shape[1], rows, columns, len(rows), self._tuning, share,
        )  # fmt: skip
        return share

    def measured(
        self, a: Float64, b: Float64, sight: Float64, variance: float, before: Float64
    ) -> tuple[Float64, Float64, Float64]:
        """Displacement between k-DOPs a and b (8, K) with its covariance, and the variance by ends that disagree."""
        n = a.shape[1]
        shift = np.empty((n, 2))
        covariance = np.empty((n, 2, 2))
        end_variance = np.empty((4, n))
        self.library.modt_measured(a, b, sight, n, variance, before, self._tuning, shift, covariance, end_variance)
        return shift, covariance, end_variance

    def pair_costs(
        self,
        a: Shapes,
        b: Shapes,
        covariance: Float64,
        variance: float,
        pairs: tuple[Int, Int],
        weights: PairWeights,
    ) -> tuple[Float64, Float64]:
        """(K,) cost, and overlap of the smaller one, of pairs of shapes."""
        rows, columns = pairs
        spread, cost, overlap_of_smaller = np.empty((3, len(rows)))
        shapes_a = _SHAPES.of(a, n=len(a))
        shapes_b = _SHAPES.of(b, n=len(b))
        self.library.modt_pair_costs(
            shapes_a, shapes_b, covariance, variance, rows, columns, len(rows), self._weights(weights), self._tuning,
            spread, cost, overlap_of_smaller,
        )  # fmt: skip
        return cost + np.log(spread) / 2, overlap_of_smaller

    def assign(self, rows: Int, columns: Int, cost: Float64, limit: float) -> Int:
        """Indices, ascending, of the candidate pairs that a least-cost assignment keeps."""
        n_pairs = len(rows)
        n_rows = int(rows.max(initial=-1)) + 1
        n_columns = int(columns.max(initial=-1)) + 1
        row_number = np.empty(n_rows, int64)
        column_number = np.empty(n_columns, int64)
        state = np.empty(n_pairs, np.uint8)
        contested = array("q", (0, 0))
        self.library.modt_certain_pairs(
            rows, columns, cost, n_pairs, limit, n_rows, n_columns, np.empty(n_rows + n_columns), row_number,
            column_number, state, contested,
        )  # fmt: skip
        few, many = contested
        if few > many:  # the assignment wants at least as many columns as rows
            few, many = many, few
            rows, columns = columns, rows
            row_number, column_number = column_number, row_number
        if few:
            assignment = _ASSIGNMENT.allocate(rows=few, columns=many)
            if not self.library.modt_settle_pairs(
                rows, columns, cost, n_pairs, limit, row_number, column_number, assignment, state
            ):
                raise ValueError("no assignment has a finite cost")
        return state.nonzero()[0]  # 0: left out, see assignment.c

    def sort_members(
        self, members: Int, coordinates: Float32, offsets: Int, label: Int, moved: tuple[Int, Int], n: int
    ) -> tuple[Int, Float32, Int]:
        """Members and (3, K) coordinates by the label of their group or, if moved, their own; (n,) count of each."""
        member_rows, own_label = moved
        sorted_members = np.empty_like(members)
        sorted_coordinates = np.empty_like(coordinates)
        count = np.empty(n, int64)
        self.library.modt_sort_members(
            members, coordinates, len(members), offsets, len(label), label, member_rows, own_label, len(member_rows),
            n, np.empty(n, int64), count, sorted_members, sorted_coordinates,
        )  # fmt: skip
        return sorted_members, sorted_coordinates, count
