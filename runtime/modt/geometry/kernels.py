"""The passes over points and over pairs of k-DOPs."""

from __future__ import annotations

import numpy as np

from modt.geometry.boxes import upright_boxes
from modt.geometry.kdop import certain_pairs, kdop_ends, overlapping_pairs, pair_costs
from modt.types import Bool, Float32, Float64, Int, copy_runs


class GeometryKernels:
    """The passes in NumPy and SciPy: the reference. A subclass with compiled ones gives the same bytes.

    Sums alone may differ in their last bit, since NumPy adds in another order: in double precision the sum of single
    precision numbers is exact in any order, unless one of them is 2^29 times smaller than another.
    """

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
        """(R, C) pairs of the assignment of least cost, one in each row or one in each column.

        Raises:
            ValueError: every assignment has an infinite cost.
        """
        from scipy.optimize import linear_sum_assignment  # large, and the compiled kernels do without

        chosen = np.zeros(cost.shape, np.bool_)
        chosen[linear_sum_assignment(cost)] = True
        return chosen


NUMPY_GEOMETRY = GeometryKernels()
