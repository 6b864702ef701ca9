"""The passes over points and over pairs of k-DOPs."""

from __future__ import annotations

import ctypes

import numpy as np

from modt.geometry.boxes import upright_boxes
from modt.geometry.kdop import (
    PairWeights,
    Shapes,
    certain_pairs,
    in_plane,
    kdop_ends,
    mahalanobis,
    nearer_ends,
    overlap_shares,
    overlapping_pairs,
    shift_along_axes,
    widths,
)
from modt.geometry.tuning import ShapeTuning
from modt.types import Float32, Float64, Int, copy_runs, sort_members


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
    kdop_ends = staticmethod(kdop_ends)
    copy_runs = staticmethod(copy_runs)
    sort_members = staticmethod(sort_members)
    overlapping_pairs = staticmethod(overlapping_pairs)
    assign = staticmethod(assign)

    def __init__(self, tuning: ShapeTuning = ShapeTuning()) -> None:
        self.shape_tuning = tuning

    def coverage(self, a: Float64, b: Float64, rows: Int, columns: Int) -> Float64:
        """(K,) share of a k-DOP of a that one of b covers: the lesser of the shares of the two rectangles around it.

        Args:
            a: (8, n) k-DOPs.
            b: (8, k) k-DOPs that may cover them.
            rows: (K,) index among a of each pair.
            columns: (K,) its index among b.
        """
        covered = a.take(rows, axis=1)
        extended = b.take(columns, axis=1) + self.shape_tuning.end_jitter_m
        common = np.maximum(widths(np.minimum(covered, extended)), 0.0)
        share = common / np.maximum(widths(covered), self.shape_tuning.end_jitter_m)
        least: Float64 = np.minimum(share[0] * share[2], share[1] * share[3])
        return least

    def pair_costs(
        self,
        a: Shapes,
        b: Shapes,
        covariance: Float64,
        variance: float,
        pairs: tuple[Int, Int],
        weights: PairWeights,
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
            overlap_of_smaller: (K,) intersection over the smaller of the two.
        """
        rows, columns = pairs
        kdop_a = a.kdop.take(rows, axis=1)
        kdop_b = b.kdop.take(columns, axis=1)
        distance, spread = mahalanobis(kdop_b - kdop_a, covariance.take(rows, axis=1), variance)
        overlap, overlap_of_smaller = overlap_shares(kdop_a, kdop_b, self.shape_tuning)
        size = np.abs(b.log_width.take(columns, axis=1) - a.log_width.take(rows, axis=1)).sum(axis=0) / 4
        height = np.abs(a.top[rows] - b.top[columns]) + np.abs(a.bottom[rows] - b.bottom[columns])
        points = np.abs(a.log_points[rows] - b.log_points[columns])
        shape = weights.size * size + weights.overlap * (1 - overlap)
        shape += weights.height * height / 2 + weights.points * points
        return distance / 2 + shape + np.log(spread) / 2, overlap_of_smaller

    def measured(
        self, a: Float64, b: Float64, sight: Float64, variance: float, before: Float64
    ) -> tuple[Float64, Float64, Float64]:
        """Displacement between k-DOPs with its covariance.

        An end of a k-DOP that comes into view, or is hidden, moves; the other stays. Along each of the four axes the
        object moved by the mean of both ends where they agree. Where they do not, it moved as the end that is nearer
        to the sensor, since an object hides its own far end. Across the line of sight it moved as the end that moved
        less.
        The disagreement of the two ends is a variance of the position along that axis, which lasts: the next k-DOP is
        compared with one that was already in doubt.

        Args:
            a: (8, K) k-DOPs before [m].
            b: (8, K) and after [m].
            sight: (2, K) unit vectors from the sensor to the objects; zero where no end is nearer.
            variance: variance of the displacement if the ends agree [m2].
            before: (4, K) variance along each axis by ends that disagreed, a frame ago [m2].

        Returns:
            shift: (K, 2) from a to b [m].
            covariance: (K, 2, 2) covariance of the displacement [m2].
            end_variance: (4, K) variance along each axis by ends that disagree, or did [m2].
        """
        tuning = self.shape_tuning
        nearer = nearer_ends(sight, tuning)
        along, disagreement, growth = shift_along_axes(a, b, tuning, nearer)
        # What comes into view across the line of sight moves the nearer end of an oblique axis too.
        doubt_near = tuning.near_disagreement * tuning.near_disagreement
        doubt_across = tuning.disagreement * tuning.disagreement
        near_share = nearer * nearer
        doubt = near_share * doubt_near + (1 - near_share) * doubt_across
        end_variance = np.maximum(doubt * disagreement * np.square(growth), tuning.end_variance_decay * before)
        np.minimum(end_variance, doubt * np.square(widths(b).max(axis=0)), out=end_variance)
        # The four axes together weigh as much as one measurement in each direction.
        weight = 0.5 / (variance + end_variance)
        x, y = in_plane(weight * along)
        # The inverse of the covariance is the sum over the axes of weight * axis * axis'.
        east, north_east, north, north_west = weight
        inverse_xx = east + (north_east + north_west) / 2
        inverse_yy = north + (north_east + north_west) / 2
        inverse_xy = (north_east - north_west) / 2
        scale = 1.0 / (inverse_xx * inverse_yy - inverse_xy * inverse_xy)
        covariance = np.empty((len(x), 2, 2))
        covariance[:, 0, 0] = xx = scale * inverse_yy
        covariance[:, 1, 1] = yy = scale * inverse_xx
        covariance[:, 0, 1] = covariance[:, 1, 0] = xy = -scale * inverse_xy
        shift = np.empty((len(x), 2))
        shift[:, 0] = xx * x + xy * y
        shift[:, 1] = xy * x + yy * y
        return shift, covariance, end_variance

    def group_sums(self, values: Float32, offsets: Int) -> Float64:
        """(V, G) sum of the values of each group, given (V, K) in their order."""
        total: Float64 = np.add.reduceat(values, offsets[:-1], axis=1, dtype=np.float64)
        return total


NUMPY_GEOMETRY = GeometryKernels()
