"""The association that tracks live by: what survives a change of view, gated by the filter."""

from __future__ import annotations

import numpy as np

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.geometry.kdop import AXES, DIRECTIONS, overlapping_pairs, width_sum, widths
from modt.observations import Observations
from modt.tracking import kalman
from modt.tracking.association import Matches, assign
from modt.tracking.displacement import least, measured, shift_between
from modt.tracking.track_table import TrackTable
from modt.types import Bool, Float64, Int

SOFT_M = 0.3
"""Lengths are compared with this added: a difference of a few returns says nothing."""
GATE = 16.0
"""Greatest squared Mahalanobis distance of a pair: one true pair in three thousand lies beyond."""
JUMP_M = 0.2
"""Outlines jump by this much beyond the filter's noise, as parts of an object come into view and go."""
COVER = 0.3
"""Overlap, of the smaller, of what is paired although it changed its shape."""
GROWTH = 1.5
"""An object does not become this many times longer, plus a metre, from one frame to the next."""
LIMIT = 10.0
"""Cost of leaving a track without a proposal."""
W_SIZE, W_OVERLAP, W_HEIGHT, W_COUNT = 2.0, 3.0, 2.0, 0.5


class KdopAssociation:
    """Matches outlines, not centres.

    What is seen of an object changes with the view: its far side appears, a pole hides its rear, the field of view
    cuts it. Along each of four axes an outline has two ends. Where both moved alike, the object moved by their mean;
    where they did not, one of them usually stayed, and the smaller of the two shifts from where the filter expects
    them is taken for the object's own. (The smaller of two alike would fall short of every motion.) Pairs are
    gated by the smaller shifts alone.

    Args:
        config: deviation of a measured place.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self.config = config

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs within the gate; then, among what is left, those that overlap although they changed their shape."""
        expected = predicted_kdops(tracks)
        variance = self.noise(observations)
        rows, columns = self._near(tracks, expected, observations)
        a, b = expected.take(rows, axis=1), observations.kdop.take(columns, axis=1)
        size, overlap, cover = shape_similarity(a, b)
        S = tracks.P[:, :2, :2].transpose(1, 2, 0).copy().take(rows, axis=2)
        noise = variance[columns] + JUMP_M**2
        for k in (0, 1):
            S[k, k] += noise
        distance = kalman.mahalanobis_squared(AXES @ least(a, b) / 2, S)  # what changed its shape may be far off
        height = np.abs(tracks.top[rows] - observations.top[columns])
        bottom = np.abs(tracks.bottom[rows] - observations.bottom[columns])
        count = np.abs(np.log(tracks.points[rows] / observations.count[columns]))
        shape = W_SIZE * size + W_OVERLAP * (1 - overlap) + W_HEIGHT * (height + bottom) / 2 + W_COUNT * count
        cost = distance / 2 + shape
        first = ((distance < GATE) & (cost < LIMIT)).nonzero()[0]
        first = first[assign(rows[first], columns[first], cost[first], LIMIT)]
        left = _left(rows, rows[first], len(tracks)) & _left(columns, columns[first], len(observations))
        second = (left & (cover > COVER)).nonzero()[0]
        second = second[~self._swallowed(tracks, observations, rows[second], columns[second])]
        second = second[assign(rows[second], columns[second], 1 - cover[second], 1.0)]
        kept = np.concatenate([first, second])
        rows, columns = rows[kept], columns[kept]
        x = tracks.x.take(rows, axis=0)[:, :2]
        a, b = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ x.T, b.take(kept, axis=1)
        shift, covariance, end_variance = measured(a, b, variance[columns], tracks.end_variance.T.take(rows, axis=1))
        covariance *= np.maximum(1.0, distance[kept] / 4)[:, None, None]  # heavy tails: what lies far off says less
        return Matches(rows, columns, x + shift, covariance, end_variance.T)

    def _swallowed(self, tracks: TrackTable, observations: Observations, rows: Int, columns: Int) -> Bool:
        """(K,) pairs in which an object would become a part of something larger: it waits until they part again."""
        grown = widths(observations.kdop.take(columns, axis=1)).max(axis=0)
        known = widths(tracks.envelope.take(rows, axis=0).T).max(axis=0)
        scenery = tracks.final[rows] & (tracks.last_class[rows] == ObjectClass.BACKGROUND.value)
        swallowed: Bool = ~scenery & (grown > GROWTH * known + 1.0)
        return swallowed

    def initial_position(self, observations: Observations) -> Float64:
        """Middle of the outline."""
        return observations.position

    def noise(self, observations: Observations) -> Float64:
        """(P,) variance of a place [m2]: ends of outlines jitter by the spacing of returns, and more where cut."""
        extent = width_sum(observations.kdop) / 4
        sigma = 0.06 + 0.001 * observations.range_m + 0.03 * np.minimum(extent, 3.0)
        sigma = np.where(observations.partial, 1.5 * sigma, sigma)
        variance: Float64 = np.square(sigma)
        return variance

    def _near(self, tracks: TrackTable, expected: Float64, observations: Observations) -> tuple[Int, Int]:
        """Pairs whose outlines come near enough along x and along y."""
        reach = 0.5 + 3 * np.sqrt(np.maximum(tracks.P[:, 0, 0], tracks.P[:, 1, 1]))
        return overlapping_pairs(expected + reach, observations.kdop)


def predicted_kdops(tracks: TrackTable, rows: Int | slice = slice(None)) -> Float64:
    """(8, R) the outlines last seen of the rows, of all by default, where the filter expects them now."""
    kdop: Float64 = (tracks.kdop[rows] + (tracks.x[rows, :2] - tracks.anchor[rows]) @ DIRECTIONS).T.copy()
    return kdop


def compare(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64, Float64]:
    """How outlines b (8, K) lie to outlines a (8, K), one by one.

    Returns:
        shift: (K, 2) from a to b [m], by both ends along each axis where they agree, else by that which moved less.
        size: (K,) mean difference of the logarithms of their lengths.
        overlap: (K,) intersection over union.
        cover: (K,) intersection over the smaller of the two.
    """
    return shift_between(a, b), *shape_similarity(a, b)


def shape_similarity(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64]:
    """(K,) compare's size, overlap and cover."""
    length_a, length_b = widths(a), widths(b)
    size = np.abs(np.log((length_b + SOFT_M) / (length_a + SOFT_M))).sum(axis=0) / 4
    pad = SOFT_M / 3
    common = np.maximum(widths(np.minimum(a, b)) + pad, 0.0)
    squares = [side[:2] * side[2:] for side in (length_a + pad, length_b + pad)]
    shared = common[:2] * common[2:]  # in the upright square, and in the one on its corner
    overlap = np.minimum(*(shared / (squares[0] + squares[1] - shared)))
    cover = np.minimum(*(shared / np.minimum(*squares)))
    return size, overlap, cover


def _left(all_: Int, taken: Int, n: int) -> Bool:
    """(K,) which of the indices were not taken."""
    gone = np.zeros(n, np.bool_)
    gone[taken] = True
    left: Bool = ~gone[all_]
    return left
