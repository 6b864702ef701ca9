"""The passes over points and over pairs of k-DOPs, as one interface."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.geometry.boxes import upright_boxes
from modt.geometry.kdop import PairWeights, Shapes, certain_pairs, kdop_ends, overlapping_pairs, pair_costs
from modt.types import Bool, Float32, Float64, Int, copy_runs


class GeometryKernels(Protocol):
    """The passes; every implementation gives the same bytes for the same input.

    Sums alone may differ in their last bit, since NumPy adds in another order: in double precision the sum of single
    precision numbers is exact in any order, unless one of them is 2^29 times smaller than another.
    """

    def upright_boxes(self, xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
        """(G, 7) boxes at (G,) headings, or across them, about groups of (3, K) points."""

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""

    def kdop_ends(self, xyz: Float32, offsets: Int, axes: Float32) -> Float32:
        """(8, G) greatest coordinates of each group along (3, 4) axes, then against them, given (3, K) points."""

    def copy_runs(self, members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
        """Members and (3, ...) coordinates of (2, R) runs of them, one after the other."""

    def overlapping_pairs(self, a: Float64, b: Float64) -> tuple[Int, Int]:
        """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y."""

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

    def certain_pairs(self, rows: Int, columns: Int, cost: Float64, limit: float) -> tuple[Int, Int]:
        """Pairs that a least-cost assignment keeps for certain, and those that it must decide among."""

    def least_cost_assignment(self, cost: Float64) -> Bool:
        """(R, C) pairs of the assignment of least cost, one in each row or one in each column.

        Raises:
            ValueError: every assignment has an infinite cost.
        """


class NumpyGeometryKernels:
    """The passes in NumPy and SciPy: the reference."""

    upright_boxes = staticmethod(upright_boxes)
    kdop_ends = staticmethod(kdop_ends)
    copy_runs = staticmethod(copy_runs)
    overlapping_pairs = staticmethod(overlapping_pairs)
    pair_costs = staticmethod(pair_costs)
    certain_pairs = staticmethod(certain_pairs)

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        total: Float64 = np.add.reduceat(values, offsets[:-1], axis=1, dtype=np.float64)
        return total

    def least_cost_assignment(self, cost: Float64) -> Bool:
        """(R, C) pairs of the assignment of least cost, one in each row or one in each column."""
        from scipy.optimize import linear_sum_assignment  # large, and the compiled kernels do without

        chosen = np.zeros(cost.shape, np.bool_)
        chosen[linear_sum_assignment(cost)] = True
        return chosen


NUMPY_GEOMETRY = NumpyGeometryKernels()
