"""Least-cost assignment of sparse pairs."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.types import Float64, Int


def assign(rows: Int, columns: Int, cost: Float64, limit: float) -> Int:
    """Indices of the candidate pairs that a least-cost assignment keeps.

    A pair is kept for certain if the next best pairs of its row and of its column together cost more than the pair
    and limit, the most that their partners then lose. The Hungarian algorithm decides among the other pairs.

    Args:
        rows: (K,) first index of each candidate pair.
        columns: (K,) second index; no pair occurs twice.
        cost: (K,) of each, below limit.
        limit: cost of leaving a row or a column without a partner.
    """
    if len(rows) < 2:
        return np.arange(len(rows))
    order = (-cost).argsort()
    rows, columns, cost = rows[order], columns[order], cost[order]
    of_row, other_row = _two_best(rows, cost, limit)
    of_column, other_column = _two_best(columns, cost, limit)
    kept = cost + limit < other_row + other_column
    contested = (~(kept[of_row] | kept[of_column])).nonzero()[0]
    if len(contested):
        i, n = _compact(rows[contested])
        j, k = _compact(columns[contested])
        matrix, chosen = np.full((n, k), limit), np.zeros((n, k), np.bool_)
        matrix[i, j] = cost[contested]
        chosen[linear_sum_assignment(matrix)] = True
        kept[contested] = chosen[i, j]
    pairs: Int = order[kept]
    pairs.sort()
    return pairs


def _two_best(index: Int, cost: Float64, limit: float) -> tuple[Int, Float64]:
    """(K,) best pair of the same index, (K,) cost of the next best or limit; pairs sorted by falling cost."""
    k = np.arange(len(index))
    best = np.empty(index.max() + 1, np.int64)
    best[index] = k  # the last written is the cheapest
    of_index = best[index]
    others = (of_index != k).nonzero()[0]
    next_best = np.full(len(best), limit)
    next_best[index[others]] = cost[others]
    return of_index, next_best[index]


def _compact(index: Int) -> tuple[Int, int]:
    """Indices renumbered without gaps, and how many there are."""
    number = (np.bincount(index) > 0).cumsum()
    return number[index] - 1, int(number[-1])
