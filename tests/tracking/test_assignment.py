"""Sparse least-cost assignment against the dense one and against exhaustive search."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from modt.geometry.kernels import assign


def assigned(cost, limit):
    """Rows and columns that assign keeps of a dense matrix, of the pairs below the limit."""
    rows, columns = np.nonzero(cost < limit)
    kept = assign(rows, columns, cost[rows, columns], limit)
    rows, columns = rows[kept], columns[kept]
    assert len(set(rows)) == len(set(columns)) == len(kept)
    return rows, columns


@given(st.integers(0, 12), st.integers(0, 12), st.floats(0.5, 8), st.integers(0, 2**16))
def test_the_sparse_assignment_is_the_dense_one(n, k, limit, seed):
    cost = np.random.default_rng(seed).uniform(0, 8, (n, k))
    i, j = linear_sum_assignment(np.minimum(cost, limit))
    real = cost[i, j] < limit
    rows, columns = assigned(cost, limit)
    np.testing.assert_array_equal(rows, i[real])
    np.testing.assert_array_equal(columns, j[real])
