"""Least-cost assignment of sparse pairs."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.types import Float64, Int


def assign(rows: Int, columns: Int, cost: Float64, limit: float, kernels: GeometryKernels = NUMPY_GEOMETRY) -> Int:
    """Indices, ascending, of the candidate pairs that a least-cost assignment keeps.

    Most pairs are certain; the Hungarian algorithm decides among the others.

    Args:
        rows: (K,) first index of each candidate pair.
        columns: (K,) second index; no pair occurs twice.
        cost: (K,) of each, below limit.
        limit: cost of leaving a row or a column without a partner.
        kernels: passes over pairs.
    """
    if len(rows) < 2:
        return np.arange(len(rows))
    certain, contested = kernels.certain_pairs(rows, columns, cost, limit)
    if not len(contested):
        return certain
    i, n = _compact(rows[contested])
    j, k = _compact(columns[contested])
    matrix, chosen = np.full((n, k), limit), np.zeros((n, k), np.bool_)
    matrix[i, j] = cost[contested]
    chosen[linear_sum_assignment(matrix)] = True
    pairs: Int = np.concatenate([certain, contested[chosen[i, j]]])
    pairs.sort()
    return pairs


def _compact(index: Int) -> tuple[Int, int]:
    """Indices renumbered without gaps, and how many there are."""
    number = (np.bincount(index) > 0).cumsum()
    return number[index] - 1, int(number[-1])
