"""k-DOPs: extents of point sets in eight directions of the ground plane (discrete oriented polytopes, k = 8).

A k-DOP is eight numbers: the greatest coordinate of its points along each of DIRECTIONS. Opposite directions are
four apart: the ends along axis k are at kdop[k] and at -kdop[k + 4]. The k-DOP of a union is the maximum of both.
Many are an (8, n) array, a contiguous row a direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modt.geometry.tuning import ShapeTuning
from modt.types import Bool, Float32, Float64, Int, Self

_BEARINGS_RAD = np.deg2rad([0.0, 45.0, 90.0, 135.0])
AXES = np.stack([np.cos(_BEARINGS_RAD), np.sin(_BEARINGS_RAD)])
"""(2, 4) unit vectors of the axes, world frame."""
DIRECTIONS = np.concatenate([AXES, -AXES], axis=1)
"""(2, 8) the directions: each axis forth, then each axis back."""
HALF_ROOT = float(np.sqrt(0.5))
"""Components of the axes at 45 and 135 degrees."""


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
    starts = offsets[:-1]
    greatest = np.maximum.reduceat(along, starts, axis=1)
    least = np.minimum.reduceat(along, starts, axis=1)
    return np.concatenate([greatest, -least])


def widths(kdop: Float64) -> Float64:
    """(4, n) from end to end along each axis, of (8, n) k-DOPs [m]."""
    width: Float64 = kdop[:4] + kdop[4:]
    return width


def centres(kdop: Float64) -> Float64:
    """(4, n) middle along each axis, of (8, n) k-DOPs [m]."""
    centre: Float64 = (kdop[:4] - kdop[4:]) / 2
    return centre


def overlapping_pairs(a: Float64, b: Float64) -> tuple[Int, Int]:
    """Pairs of k-DOPs a (8, n) and b (8, k) that overlap along x and along y.

    Returns:
        rows: (K,) index of each pair among a, ascending.
        columns: (K,) its index among b, ascending for equal rows.
    """
    overlap: Bool = a[0][:, None] >= -b[4]
    for side in (2, 4, 6):
        overlap &= a[side][:, None] >= -b[side - 4]
    pair = overlap.ravel().nonzero()[0]
    rows = pair // overlap.shape[1]
    return rows, pair - rows * overlap.shape[1]


class PairWeights(NamedTuple):
    """Weights of the differences in the cost of a pair, beside the likelihood of its displacement."""

    size: float  # mean difference of the logarithms of the widths
    overlap: float  # of 1 - intersection over union
    height: float  # mean difference of bottom and top [1/m]
    points: float  # difference of the logarithms of their numbers


@dataclass(frozen=True)
class Shapes:
    """n k-DOPs with what is compared of them."""

    kdop: Float64  # (8, n) [m]
    log_width: Float64  # (4, n)
    bottom: Float64  # (n,) [m]
    top: Float64  # (n,) [m]
    log_points: Float64  # (n,)

    @classmethod
    def of(cls, kdop: Float64, bottom: Float64, top: Float64, points: Int, tuning: ShapeTuning) -> Self:
        """Make shapes from (8, n) k-DOPs with (n,) bottoms, tops and numbers of points."""
        return cls(kdop, np.log(widths(kdop) + tuning.width_softening_m), bottom, top, np.log(points))

    def __len__(self) -> int:
        return len(self.top)


def overlap_shares(a: Float64, b: Float64, tuning: ShapeTuning) -> tuple[Float64, Float64]:
    """Areas that k-DOPs a and b (8, K) have in common, one by one.

    Areas are those of the upright rectangles or of those at 45 degrees, whichever give less.

    Returns:
        overlap: (K,) intersection over union.
        overlap_of_smaller: (K,) intersection over the smaller of the two.
    """
    padding_m = tuning.area_padding_m
    area_a = _rectangle_areas(widths(a) + padding_m)
    area_b = _rectangle_areas(widths(b) + padding_m)
    common = _rectangle_areas(np.maximum(widths(np.minimum(a, b)) + padding_m, 0.0))
    overlap = common / (area_a + area_b - common)
    overlap_of_smaller = common / np.minimum(area_a, area_b)
    return np.minimum(*overlap), np.minimum(*overlap_of_smaller)


def _rectangle_areas(width: Float64) -> Float64:
    """(2, K) areas of the upright rectangle and of that at 45 degrees, given (4, K) widths along the axes [m2]."""
    area: Float64 = width[:2] * width[2:]
    return area


def mahalanobis(outward: Float64, covariance: Float64, variance: float) -> tuple[Float64, Float64]:
    """Displacements by the ends that moved less, relative to the uncertainty of the position.

    Args:
        outward: (8, K) displacement of each end [m].
        covariance: (3, K) xx, xy and yy of the position [m2].
        variance: further variance along x and y [m2].

    Returns:
        distance: (K,) squared Mahalanobis distance.
        spread: (K,) determinant of the covariance, relative to its least value.
    """
    ahead = outward[:4]
    behind = -outward[4:]
    x, y = in_plane(np.where(np.abs(ahead) < np.abs(behind), ahead, behind))
    dx = x / 2  # the axes count each direction twice: AXES @ AXES.T = 2 I
    dy = y / 2
    xx, xy, yy = covariance
    xx = xx + variance
    yy = yy + variance
    determinant = xx * yy - xy * xy
    distance = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / determinant
    return distance, determinant / variance**2


def in_plane(along: Float64) -> tuple[Float64, Float64]:
    """(K,) x and (K,) y of the sum of the vectors along the four axes, of which (4, K) lengths are given."""
    east, north_east, north, north_west = along
    return east + HALF_ROOT * (north_east - north_west), north + HALF_ROOT * (north_east + north_west)


def certain_pairs(rows: Int, columns: Int, cost: Float64, limit: float) -> tuple[Int, Int]:
    """Pairs that a least-cost assignment keeps for certain, and those that it must decide among.

    A pair is certain if taking the second-cheapest pairs of its row and its column instead would cost more than the
    pair and one missing partner, which costs limit. An assignment without the pair spends at least these two costs on
    its row and its column. With the pair, the partners that they had there are left over, and cost at most limit
    together. Only a pair that is the cheapest of both its row and its column can be certain.

    A pair is contested if neither the cheapest pair of its row nor that of its column is certain. All other pairs,
    rivals of a certain one, are left out.

    Args:
        rows: (K,) first index of each pair.
        columns: (K,) second index.
        cost: (K,) cost of each pair, below limit.
        limit: cost of leaving a row or a column without a partner.

    Returns:
        (C,) indices of the certain pairs and (D,) of the contested ones, ascending.
    """
    cheapest_of_row, second_cost_of_row = _two_cheapest(rows, cost, limit)
    cheapest_of_column, second_cost_of_column = _two_cheapest(columns, cost, limit)
    certain = cost + limit < second_cost_of_row + second_cost_of_column
    contested = ~(certain[cheapest_of_row] | certain[cheapest_of_column])
    return certain.nonzero()[0], contested.nonzero()[0]


def _two_cheapest(index: Int, cost: Float64, limit: float) -> tuple[Int, Float64]:
    """Cheapest pair, and cost of the second cheapest, of the row (or column) of each pair.

    Args:
        index: (K,) row, or column, of each pair.
        cost: (K,) cost of each pair.
        limit: cost of having no partner.

    Returns:
        cheapest: (K,) cheapest pair of the row of each pair, the last one of equals; it may be the pair itself.
        second_cost: (K,) cost of the second cheapest of that row, limit where there is none.
    """
    latest_first = -np.arange(len(index))
    order = np.lexsort((latest_first, cost, index))
    is_first = np.diff(index[order], prepend=-1) != 0  # among those with the same index, in this order
    is_second = ~is_first
    is_second[1:] &= is_first[:-1]
    first = order[is_first]
    second = order[is_second]
    cheapest = np.empty(index.max(initial=-1) + 1, np.int64)
    cheapest[index[first]] = first
    second_cost = np.full(len(cheapest), limit)
    second_cost[index[second]] = cost[second]
    return cheapest[index], second_cost[index]


def shift_between(a: Float64, b: Float64, tuning: ShapeTuning) -> Float64:
    """(K, 2) displacement from k-DOPs a to b [m], all axes weighted alike."""
    along, _, _ = shift_along_axes(a, b, tuning)
    shift: Float64 = (AXES @ along).T / 2  # AXES @ AXES.T = 2 I
    return shift


def nearer_ends(sight: Float64, tuning: ShapeTuning) -> Float64:
    """(4, K) cosine between each axis and the line of sight; 0 where neither end is nearer to the sensor.

    The end behind is the nearer one where it is positive, the end ahead where it is negative.

    Args:
        sight: (2, K) unit vectors from the sensor to the objects.
        tuning: how far an axis may be from the line of sight.
    """
    x, y = sight
    along = np.stack([x, HALF_ROOT * (x + y), y, HALF_ROOT * (y - x)])
    nearer: Float64 = along * (np.abs(along) > tuning.near_cosine)
    return nearer


def shift_along_axes(
    a: Float64, b: Float64, tuning: ShapeTuning, nearer: Float64 | None = None
) -> tuple[Float64, Float64, Float64]:
    """Displacement along each axis from k-DOPs a to b (8, K), given the (4, K) `nearer_ends`.

    Returns:
        shift: (4, K) mean of both ends where they agree, else that of the nearer end, or else of the end that moved
            less [m].
        disagreement: (4, K) from 0, where both ends moved alike, to 1.
        growth: (4, K) growth of the width, which is the difference between the displacements of the ends [m].
    """
    outward = b - a
    both = outward[:4] - outward[4:]
    growth = outward[:4] + outward[4:]
    width = widths(b)
    longest = np.maximum(width, width - growth).max(axis=0)  # of the widths after and before
    relative_growth = growth * (np.maximum(longest, 1.0) / tuning.agreement_m)
    disagreement = 1 - np.square(np.maximum(1 - np.square(relative_growth), 0.0))
    # The displacements of the ends are ahead = (both + growth) / 2 and behind = (both - growth) / 2. That of the end
    # that moved less is (|both| - |growth|) / 2, with the sign of `both`.
    to_end = np.copysign(growth, both)
    if nearer is not None:
        to_end = np.where(nearer != 0.0, np.sign(nearer) * growth, to_end)
    return (both - disagreement * to_end) / 2, disagreement, growth


def shape_similarity(a: Float64, b: Float64, tuning: ShapeTuning) -> tuple[Float64, Float64]:
    """Likeness of k-DOPs a and b (8, K), one by one.

    Returns:
        size: (K,) mean difference of the logarithms of the widths.
        overlap: (K,) intersection over union.
    """
    softening_m = tuning.width_softening_m
    size = np.abs(np.log((widths(b) + softening_m) / (widths(a) + softening_m))).sum(axis=0) / 4
    overlap, _ = overlap_shares(a, b, tuning)
    return size, overlap
