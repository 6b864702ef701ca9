"""The passes over points and over pairs of k-DOPs."""

from __future__ import annotations

import ctypes

import numpy as np

from modt.geometry import kdop
from modt.geometry.boxes import upright_boxes
from modt.geometry.tuning import ShapeTuning
from modt.types import Float32, Float64, Int, copy_runs, regrouped


def assign(rows: Int, columns: Int, cost: Float64, limit: float) -> Int:
    """Indices, ascending, of the candidate pairs that a least-cost assignment keeps.

    Most pairs are certain; the assignment decides among the others.

    Args:
        rows: (K,) first index of each candidate pair.
        columns: (K,) second index; no pair occurs twice.
        cost: (K,) cost of each pair, below limit.
        limit: cost of leaving a row or a column without a partner.

    Raises:
        ValueError: every assignment has an infinite cost.
    """
    certain, contested = kdop.certain_pairs(rows, columns, cost, limit)
    if not len(contested):
        return certain
    from scipy.optimize import linear_sum_assignment  # large, and the compiled kernels do without

    # The matrix has a row for each of the contested rows, and a column for each of the contested columns.
    contested_rows, matrix_row = np.unique(rows[contested], return_inverse=True)
    contested_columns, matrix_column = np.unique(columns[contested], return_inverse=True)
    matrix = np.full((len(contested_rows), len(contested_columns)), limit)
    matrix[matrix_row, matrix_column] = cost[contested]
    chosen = np.zeros(matrix.shape, np.bool_)
    chosen[linear_sum_assignment(matrix)] = True
    pairs: Int = np.concatenate([certain, contested[chosen[matrix_row, matrix_column]]])
    pairs.sort()
    return pairs


class GeometryKernels:
    """The passes in NumPy and SciPy: the reference. A subclass with compiled ones gives the same bytes.

    Sums alone may differ in their last bit, since NumPy adds in another order: in double precision the sum of single
    precision numbers is exact in any order, unless one of them is 2^29 times smaller than another.

    Args:
        tuning: how k-DOPs are compared.
    """

    library: ctypes.CDLL | None = None
    """Library of the compiled passes, for the kernels of other stages."""
    upright_boxes = staticmethod(upright_boxes)
    kdop_ends = staticmethod(kdop.kdop_ends)
    copy_runs = staticmethod(copy_runs)
    regrouped = staticmethod(regrouped)
    overlapping_pairs = staticmethod(kdop.overlapping_pairs)
    assign = staticmethod(assign)

    def __init__(self, tuning: ShapeTuning = ShapeTuning()) -> None:
        self.shape_tuning = tuning

    def coverage(self, a: Float64, b: Float64, rows: Int, columns: Int) -> Float64:
        """(K,) share of each k-DOP of a (8, n) that one of b (8, k) covers, see `kdop.coverage`."""
        return kdop.coverage(a, b, rows, columns, self.shape_tuning)

    def pair_costs(
        self,
        a: kdop.Shapes,
        b: kdop.Shapes,
        covariance: Float64,
        variance: float,
        pairs: tuple[Int, Int],
        weights: kdop.PairWeights,
    ) -> tuple[Float64, Float64]:
        """(K,) cost and coverage of pairs of shapes, see `kdop.pair_costs`."""
        return kdop.pair_costs(a, b, covariance, variance, pairs, weights, self.shape_tuning)

    def measured(self, a: Float64, b: Float64, variance: float, before: Float64) -> tuple[Float64, Float64, Float64]:
        """Displacement between k-DOPs a and b (8, K), its covariance and end variances, see `kdop.measured`."""
        return kdop.measured(a, b, variance, before, self.shape_tuning)

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        total: Float64 = np.add.reduceat(values, offsets[:-1], axis=1, dtype=np.float64)
        return total


NUMPY_GEOMETRY = GeometryKernels()
