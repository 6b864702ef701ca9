"""k-DOPs: extents of point sets in eight directions of the ground plane (discrete oriented polytopes, k = 8).

A k-DOP is eight numbers: the greatest coordinate of its points along each of DIRECTIONS. Opposite directions are
four apart: the ends along axis k are at kdop[k] and at -kdop[k + 4]. The k-DOP of a union is the maximum of both.
Many are an (8, n) array, a contiguous row a direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modt.types import Bool, Float32, Float64, Int, Self

_BEARINGS_RAD = np.deg2rad([0.0, 45.0, 90.0, 135.0])
AXES = np.stack([np.cos(_BEARINGS_RAD), np.sin(_BEARINGS_RAD)])
"""(2, 4) unit vectors of the axes, world frame."""
DIRECTIONS = np.concatenate([AXES, -AXES], axis=1)
"""(2, 8) the directions: each axis forth, then each axis back."""
JITTER_M = 0.15
"""Jitter of the ends of k-DOPs."""


def kdop_ends(xyz: Float32, offsets: Int, axes: Float32) -> Float32:
    """(8, G) greatest coordinates of groups of points along axes, then against them.

    Args:
        xyz: (3, K) points sorted by group [m].
        offsets: (G + 1,) group i owns the columns from offsets[i] to offsets[i + 1]; none is empty.
        axes: (3, 4) unit vectors.
    """
    along = axes[0][:, None] * xyz[0]
    along += axes[1][:, None] * xyz[1]
    along += axes[2][:, None] * xyz[2]
    ahead, behind = (f.reduceat(along, offsets[:-1], axis=1) for f in (np.maximum, np.minimum))
    return np.concatenate([ahead, -behind])


def widths(kdop: Float64) -> Float64:
    """(4, n) from end to end along each axis, of (8, n) k-DOPs [m]."""
    width: Float64 = kdop[:4] + kdop[4:]
    return width


def centres(kdop: Float64) -> Float64:
    """(4, n) middle along each axis, of (8, n) k-DOPs [m]."""
    centre: Float64 = (kdop[:4] - kdop[4:]) / 2
    return centre


def coverage(a: Float64, b: Float64, rows: Int, columns: Int) -> Float64:
    """(K,) part of a k-DOP of a (8, n) that one of b (8, k) covers: the lesser for the two rectangles around it.

    Args:
        a: n k-DOPs.
        b: k others.
        rows: (K,) index of each pair among a.
        columns: (K,) its index among b.
    """
    kdop = a.take(rows, axis=1)
    common = np.maximum(widths(np.minimum(kdop, b.take(columns, axis=1) + JITTER_M)), 0.0)
    part = common / np.maximum(widths(kdop), JITTER_M)
    least: Float64 = np.minimum(part[0] * part[2], part[1] * part[3])
    return least


def overlapping_pairs(a: Float64, b: Float64) -> tuple[Int, Int]:
    """Pairs, in order, of k-DOPs a (8, n) and b (8, k) that overlap along x and along y: two arrays of indices."""
    near: Bool = a[0][:, None] >= -b[4]
    for side in (2, 4, 6):
        near &= a[side][:, None] >= -b[side - 4]
    pair = near.ravel().nonzero()[0]
    one = pair // near.shape[1]
    return one, pair - one * near.shape[1]


HALF_ROOT = float(np.sqrt(0.5))
"""Components of the axes at 45 and 135 degrees."""
SOFT_M = 0.3
"""Added to widths that are compared: a difference of a few returns is noise."""
PAD_M = SOFT_M / 3
"""Added to widths before areas are compared."""


class PairWeights(NamedTuple):
    """Weights of the differences in the cost of a pair, beside the likelihood of its displacement."""

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
        """Make shapes from (8, n) k-DOPs with (n,) bottoms, tops and numbers of points."""
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
        variance: variance of the positions of b [m2].
        pairs: (K,) index of each among a, and among b.
        weights: weights of the terms of the cost.

    Returns:
        cost: (K,) cost of the displacement and of the differences in shape.
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
        cost: (K,) cost of each pair, below limit.
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


AGREE_M = 0.6
"""Ends whose displacements differ by less agree, of a k-DOP up to a metre long; the limit falls with the length."""
DISAGREEMENT = 0.3
"""Standard deviation of a displacement by ends that disagree, relative to the disagreement or the width, if less."""
DECAY = 0.97
"""Share of that variance that is left a frame later."""


def shift_between(a: Float64, b: Float64) -> Float64:
    """(K, 2) displacement from k-DOPs a to b [m], all axes weighted alike."""
    moved, _, _ = _moved(a, b)
    shift: Float64 = (AXES @ moved).T / 2  # four axes a quarter turn apart in pairs: A A' = 2 I
    return shift


def measured(a: Float64, b: Float64, variance: float, before: Float64) -> tuple[Float64, Float64, Float64]:
    """Displacement between k-DOPs with its covariance.

    An end of a k-DOP that comes into view, or is hidden, moves; the other stays. Along each of the four axes the
    object moved by the mean of both ends where they agree, else by the displacement of the end that moved less. The
    disagreement of the two ends is a variance of the position along that axis, which lasts: the next k-DOP is
    compared with one that was already in doubt.

    Args:
        a: (8, K) k-DOPs before [m].
        b: (8, K) and after [m].
        variance: variance of the displacement if the ends agree [m2].
        before: (4, K) variance along each axis by ends that disagreed, a frame ago [m2].

    Returns:
        shift: (K, 2) from a to b [m].
        covariance: (K, 2, 2) covariance of the displacement [m2].
        end_variance: (4, K) variance along each axis by ends that disagree, or did [m2].
    """
    width = widths(b)
    moved, unlike, apart = _moved(a, b)
    end_variance = np.maximum(DISAGREEMENT**2 * unlike * np.square(apart), DECAY * before)
    np.minimum(end_variance, DISAGREEMENT**2 * np.square(width.max(axis=0)), out=end_variance)
    # The four axes together weigh as much as one measurement in each direction.
    weight = 0.5 / (variance + end_variance)
    east, north_east, north, north_west = weight
    xx, yy = east + (north_east + north_west) / 2, north + (north_east + north_west) / 2
    xy = (north_east - north_west) / 2
    east, north_east, north, north_west = weight * moved
    x, y = east + HALF_ROOT * (north_east - north_west), north + HALF_ROOT * (north_east + north_west)
    scale = 1.0 / (xx * yy - xy * xy)
    xx, yy, xy = scale * yy, scale * xx, -scale * xy  # the inverse
    shift, covariance = np.empty((len(x), 2)), np.empty((len(x), 2, 2))
    shift[:, 0], shift[:, 1] = xx * x + xy * y, xy * x + yy * y
    covariance[:, 0, 0], covariance[:, 1, 1] = xx, yy
    covariance[:, 0, 1] = covariance[:, 1, 0] = xy
    return shift, covariance, end_variance


def _moved(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64]:
    """Displacement along each axis from k-DOPs a to b (8, K).

    Returns:
        moved: (4, K) mean of both ends where they agree, else that of the end that moved less [m].
        unlike: (4, K) from 0, where both ends moved alike, to 1.
        apart: (4, K) difference of their displacements outward [m].
    """
    width, gain = widths(b), b - a
    both, apart = gain[:4] - gain[4:], gain[:4] + gain[4:]
    longest = np.maximum(width, width - apart).max(axis=0)
    unlike = 1 - np.square(np.maximum(1 - np.square(apart * (np.maximum(longest, 1.0) / AGREE_M)), 0.0))
    return (both - unlike * np.copysign(apart, both)) / 2, unlike, apart


def shape_similarity(a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """(K,) mean difference of the logarithms of the widths of k-DOPs a and b (8, K), one by one, and (K,) overlap."""
    size = np.abs(np.log((widths(b) + SOFT_M) / (widths(a) + SOFT_M))).sum(axis=0) / 4
    return size, shares(a, b)[0]
