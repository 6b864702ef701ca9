"""The passes over points and over pairs of k-DOPs."""

from __future__ import annotations

import ctypes

import numpy as np

from modt.geometry.boxes import upright_boxes
from modt.geometry.kdop import certain_pairs, coverage, kdop_ends, measured, overlapping_pairs, pair_costs
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
    certain, contested = certain_pairs(rows, columns, cost, limit)
    if not len(contested):
        return certain
    from scipy.optimize import linear_sum_assignment  # large, and the compiled kernels do without

    (one, i), (other, j) = (np.unique(index[contested], return_inverse=True) for index in (rows, columns))
    matrix, chosen = np.full((len(one), len(other)), limit), np.zeros((len(one), len(other)), np.bool_)
    matrix[i, j] = cost[contested]
    chosen[linear_sum_assignment(matrix)] = True
    pairs: Int = np.concatenate([certain, contested[chosen[i, j]]])
    pairs.sort()
    return pairs


class GeometryKernels:
    """The passes in NumPy and SciPy: the reference. A subclass with compiled ones gives the same bytes.

    Sums alone may differ in their last bit, since NumPy adds in another order: in double precision the sum of single
    precision numbers is exact in any order, unless one of them is 2^29 times smaller than another.
    """

    library: ctypes.CDLL | None = None
    """Library of the compiled passes, for the kernels of other stages."""
    upright_boxes = staticmethod(upright_boxes)
    kdop_ends = staticmethod(kdop_ends)
    copy_runs = staticmethod(copy_runs)
    regrouped = staticmethod(regrouped)
    overlapping_pairs = staticmethod(overlapping_pairs)
    coverage = staticmethod(coverage)
    pair_costs = staticmethod(pair_costs)
    measured = staticmethod(measured)
    assign = staticmethod(assign)

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        total: Float64 = np.add.reduceat(values, offsets[:-1], axis=1, dtype=np.float64)
        return total


NUMPY_GEOMETRY = GeometryKernels()
