"""The default association: k-DOPs instead of centroids, costed by the filter."""

from __future__ import annotations

import numpy as np

from modt.geometry.kdop import DIRECTIONS, PairWeights, Shapes
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.tracking.association import Matches
from modt.tracking.track_table import TrackTable
from modt.types import Bool, Float64, Int

MAX_COST = 7.0
"""Cost of leaving a track without a proposal; no pair costs more."""
MIN_OVERLAP = 0.3
"""Least overlap, over the smaller, of a pair that changed its shape and is matched second."""
JUMP_SIGMA_M, POSITION_SIGMA_M = 0.4, 0.1
"""Deviations of a k-DOP as parts of an object come into view, and of a measured position [m]."""
WEIGHTS = PairWeights(size=2.0, overlap=3.0, height=2.0, points=0.5)
"""Cost of a unit of difference: of log sizes, of 1 - IoU, of heights [1/m], of log point numbers."""


class KdopAssociation:
    """Matches k-DOPs.

    The visible part of an object changes with the view: its far side appears, a pole hides its rear, the field of
    view cuts it. Along each of four axes a k-DOP has two ends, of which one usually stays: the smaller of their
    displacements from where the filter expects them is the object's own, and pairs are costed by it alone.

    Args:
        kernels: passes over pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs of least cost; then, among the rest, those that overlap although they changed their shape."""
        expected = tracks.predicted_kdops()
        variance = POSITION_SIGMA_M**2
        xx, xy, yy = covariance = np.array((tracks.P[:, 0, 0], tracks.P[:, 0, 1], tracks.P[:, 1, 1]))
        rows, columns = self._kernels.overlapping_pairs(expected + _reach(xx, xy, yy), observations.kdop)
        cost, coverage = self._kernels.pair_costs(
            Shapes.of(expected, tracks.bottom, tracks.top, tracks.points, self._kernels.shape_tuning),
            Shapes.of(
                observations.kdop,
                observations.bottom,
                observations.top,
                observations.count,
                self._kernels.shape_tuning,
            ),
            covariance,
            variance + JUMP_SIGMA_M**2,
            (rows, columns),
            WEIGHTS,
        )
        first = (cost < MAX_COST).nonzero()[0]
        first = first[self._kernels.assign(rows[first], columns[first], cost[first], MAX_COST)]
        second = (coverage > MIN_OVERLAP).nonzero()[0]
        second = second[_free(rows[second], rows[first], len(tracks))]
        second = second[_free(columns[second], columns[first], len(observations))]
        second = second[self._kernels.assign(rows[second], columns[second], 1 - coverage[second], 1.0)]
        kept = np.concatenate([first, second])
        rows, columns = rows[kept], columns[kept]
        x = tracks.x.take(rows, axis=0)[:, :2]
        mean = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ x.T
        before = tracks.end_variance.T.take(rows, axis=1)
        kdop = observations.kdop.take(columns, axis=1)
        shift, covariance, end_variance = self._kernels.measured(mean, kdop, variance, before)
        return Matches(rows, columns, x + shift, covariance, end_variance.T)

    def initial_position(self, observations: Observations) -> Float64:
        """Centre of the k-DOP."""
        return observations.position


def _reach(xx: Float64, xy: Float64, yy: Float64) -> Float64:
    """(M,) distance beyond which no pair of a track is listed, by the covariance of its position [m].

    It is three deviations, or fewer where a pair would cost more than MAX_COST: shapes that do not overlap cost the
    weight of the overlap at least, and an uncertain position costs its uncertainty.
    """
    least = POSITION_SIGMA_M**2 + JUMP_SIGMA_M**2
    uncertainty = np.log(((xx + least) * (yy + least) - xy * xy) / least**2)
    left = np.minimum(2 * (MAX_COST - WEIGHTS.overlap) - uncertainty, 9.0)
    reach: Float64 = 0.5 + np.sqrt(np.maximum(left, 0.0) * np.maximum(xx, yy))
    return reach


def _free(index: Int, taken: Int, n: int) -> Bool:
    """(K,) which of the indices, each below n, were not taken."""
    occupied = np.zeros(n, np.bool_)
    occupied[taken] = True
    return ~occupied[index]
