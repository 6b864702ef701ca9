"""Pairs of k-DOPs: how far one is from where the other is expected, and how unlike they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from modt.geometry.kdop import widths
from modt.types import Float64, Int

HALF_ROOT = float(np.sqrt(0.5))
"""Of the axes at 45 and 135 degrees."""
SOFT_M = 0.3
"""Added to widths that are compared: a difference of a few returns is noise."""
PAD_M = SOFT_M / 3
"""Added to widths before areas are compared."""


class PairWeights(NamedTuple):
    """What a difference adds to the cost of a pair, beside the likelihood of its displacement."""

    size: float  # mean difference of the logarithms of the widths
    overlap: float  # of 1 - intersection over union
    height: float  # mean difference of bottom and top [1/m]
    points: float  # difference of the logarithms of their numbers


@dataclass(frozen=True, slots=True)
class Shapes:
    """n k-DOPs with what is compared of them."""

    kdop: Float64  # (8, n) [m]
    log_width: Float64  # (4, n)
    bottom: Float64  # (n,) [m]
    top: Float64  # (n,) [m]
    log_count: Float64  # (n,)

    @classmethod
    def of(cls, kdop: Float64, bottom: Float64, top: Float64, count: Int) -> Self:
        """Of (8, n) k-DOPs with (n,) bottoms, tops and numbers of points."""
        return cls(kdop, np.log(widths(kdop) + SOFT_M), bottom, top, np.log(count))

    def __len__(self) -> int:
        return len(self.top)


def shares(a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """(K,) intersection over union of k-DOPs a and b (8, K), one by one, and over the smaller of the two.

    Of their upright rectangles, or of those at 45 degrees, whichever is less.
    """
    common = np.maximum(widths(np.minimum(a, b)) + PAD_M, 0.0)
    area, other_area, shared = (side[:2] * side[2:] for side in (widths(a) + PAD_M, widths(b) + PAD_M, common))
    overlap, coverage = shared / (area + other_area - shared), shared / np.minimum(area, other_area)
    return np.minimum(*overlap), np.minimum(*coverage)


def pair_costs(
    a: Shapes, b: Shapes, covariance: Float64, variance: float, pairs: tuple[Int, Int], weights: PairWeights
) -> tuple[Float64, Float64]:
    """Costs of pairs of shapes.

    The displacement of a pair, by the ends that moved less, costs the negative logarithm of its Gaussian density,
    relative to the density at no displacement from a position known exactly. The distance alone would favour
    whatever is expected least precisely.

    Args:
        a: n of them, where they are expected.
        b: k of them.
        covariance: (3, n) xx, xy and yy of the position of each of a [m2].
        variance: of the position of any of b [m2].
        pairs: (K,) index of each among a, and among b.
        weights: of the cost.

    Returns:
        cost: (K,) of the displacement, and what the differences add.
        coverage: (K,) intersection over the smaller of the two.
    """
    rows, columns = pairs
    one, other = a.kdop.take(rows, axis=1), b.kdop.take(columns, axis=1)
    xx, xy, yy = covariance.take(rows, axis=1)
    xx, yy = xx + variance, yy + variance
    gain = other - one
    ahead, behind = gain[:4], -gain[4:]
    east, north_east, north, north_west = np.where(np.abs(ahead) < np.abs(behind), ahead, behind)
    dx = (east + HALF_ROOT * (north_east - north_west)) / 2
    dy = (north + HALF_ROOT * (north_east + north_west)) / 2
    determinant = xx * yy - xy * xy
    distance = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / determinant
    overlap, coverage = shares(one, other)
    size = np.abs(b.log_width.take(columns, axis=1) - a.log_width.take(rows, axis=1)).sum(axis=0) / 4
    height = np.abs(a.top[rows] - b.top[columns]) + np.abs(a.bottom[rows] - b.bottom[columns])
    shape = weights.size * size + weights.overlap * (1 - overlap)
    shape += weights.height * height / 2 + weights.points * np.abs(a.log_count[rows] - b.log_count[columns])
    return distance / 2 + shape + np.log(determinant / variance**2) / 2, coverage


def certain_pairs(rows: Int, columns: Int, cost: Float64, limit: float) -> tuple[Int, Int]:
    """Pairs that a least-cost assignment keeps for certain, and those that it must decide among.

    A pair is kept for certain if the next best pairs of its row and of its column together cost more than the pair
    and limit, the most that their partners then lose.

    Args:
        rows: (K,) first index of each pair.
        columns: (K,) second index.
        cost: (K,) of each, below limit.
        limit: cost of leaving a row or a column without a partner.

    Returns:
        (C,) and (D,) indices of pairs, ascending.
    """
    order = (-cost).argsort(kind="stable")
    rows, columns, cost = rows[order], columns[order], cost[order]
    of_row, other_row = _two_best(rows, cost, limit)
    of_column, other_column = _two_best(columns, cost, limit)
    kept = cost + limit < other_row + other_column
    certain, contested = order[kept], order[~(kept[of_row] | kept[of_column])]
    return np.sort(certain), np.sort(contested)


def _two_best(index: Int, cost: Float64, limit: float) -> tuple[Int, Float64]:
    """(K,) best pair of the same index, (K,) cost of the next best or limit; pairs sorted by falling cost."""
    k = np.arange(len(index))
    best = np.zeros(index.max(initial=-1) + 1, np.int64)
    best[index] = k  # the last written is the cheapest
    of_index = best[index]
    others = (of_index != k).nonzero()[0]
    next_best = np.full(len(best), limit)
    next_best[index[others]] = cost[others]
    return of_index, next_best[index]
