"""The default association: k-DOPs instead of centroids, costed by the filter."""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON
from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS, PairWeights, Shapes, widths
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.tracking.association import Associated, Matches
from modt.tracking.pairs import with_rows
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import KdopAssociationTuning
from modt.types import Bool, Float64, Int


class KdopAssociation:
    """Matches k-DOPs.

    The visible part of an object changes with the view: its far side appears, a pole hides its rear, the field of
    view cuts it. Along each of four axes a k-DOP has two ends, of which one usually stays. Of the displacements of
    both from where the filter expects them only the smaller enters the cost. Differences in size, overlap, height and
    number of points are added.

    Args:
        kernels: passes over pairs.
        tuning: costs and deviations.
    """

    def __init__(
        self,
        kernels: GeometryKernels = NUMPY_GEOMETRY,
        tuning: KdopAssociationTuning = KdopAssociationTuning(),
    ) -> None:
        self._kernels = kernels
        self._tuning = tuning
        self._weights = PairWeights(
            size=tuning.size_weight,
            overlap=tuning.overlap_weight,
            height=tuning.height_weight_per_m,
            points=tuning.points_weight,
        )
        self._variance = tuning.position_sigma_m**2
        self._jump_variance = self._variance + tuning.jump_sigma_m**2

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs of least cost; then, among the rest, those that overlap although they changed their shape."""
        expected = tracks.predicted_kdops()
        covariance = np.array((tracks.P[:, 0, 0], tracks.P[:, 0, 1], tracks.P[:, 1, 1]))  # xx, xy, yy
        reached = expected + self._reach(covariance)
        rows, columns = self._kernels.overlapping_pairs(reached, observations.kdop)
        shape_tuning = self._kernels.shape_tuning
        cost, overlap_of_smaller = self._kernels.pair_costs(
            Shapes.of(expected, tracks.bottom, tracks.top, tracks.points, shape_tuning),
            Shapes.of(observations.kdop, observations.bottom, observations.top, observations.count, shape_tuning),
            covariance,
            self._jump_variance,
            (rows, columns),
            self._weights,
        )
        max_cost = self._tuning.max_cost
        # Indices are pairs: first those of like shape by cost, then, of what is left over, those that overlap.
        first = (cost < max_cost).nonzero()[0]
        first = first[self._kernels.assign(rows[first], columns[first], cost[first], max_cost)]
        second = (overlap_of_smaller > self._tuning.min_overlap).nonzero()[0]
        second = second[_free(rows[second], rows[first], len(tracks))]
        second = second[_free(columns[second], columns[first], len(observations))]
        second = second[self._kernels.assign(rows[second], columns[second], 1 - overlap_of_smaller[second], 1.0)]
        kept = np.concatenate([first, second])
        return measured(tracks, observations, rows[kept], columns[kept], self._kernels, self._variance)

    def initial_position(self, observations: Observations) -> Float64:
        """Centre of the k-DOP."""
        return observations.position

    def _reach(self, covariance: Float64) -> Float64:
        """(M,) search radius [m] of tracks whose positions have the covariance xx, xy, yy (3, M).

        It is a margin and `reach_sigmas` standard deviations of the position. The deviations are fewer where the
        missing overlap and the uncertainty of the position leave less of `max_cost` for the displacement. A jump of
        an end (`jump_sigma_m`) is covered by the margin alone.
        """
        xx, xy, yy = covariance
        variance_m2 = self._jump_variance
        uncertainty = np.log(((xx + variance_m2) * (yy + variance_m2) - xy * xy) / variance_m2**2)
        # Greatest squared displacement, in standard deviations, of a pair without overlap: it pays that weight whole.
        affordable = 2 * (self._tuning.max_cost - self._weights.overlap) - uncertainty
        squared = np.minimum(affordable, self._tuning.reach_sigmas**2)
        reach: Float64 = self._tuning.reach_margin_m + np.sqrt(np.maximum(squared, 0.0) * np.maximum(xx, yy))
        return reach


def measured(
    tracks: TrackTable,
    observations: Observations,
    rows: Int,
    proposals: Int,
    kernels: GeometryKernels,
    variance: float,
) -> Matches:
    """Matches of rows (K,) and proposals (K,), with the position that each proposal measures.

    Args:
        tracks: as predicted.
        observations: all proposals in the world.
        rows: (K,) rows of the tracks.
        proposals: (K,) proposal of each.
        kernels: passes over pairs.
        variance: variance of a position along either axis [m2].
    """
    x = tracks.x.take(rows, axis=0)[:, :2]
    mean = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ x.T
    kdop = observations.kdop.take(proposals, axis=1)
    moves = tracks.moving_probability[rows] > 0.5
    # The near end of a moving car measures, since the car hides its far end itself. The near end of a car at rest is
    # hidden by its neighbours as often.
    is_car = tracks.object_class[rows] == ObjectClass.CAR.value
    sight = observations.sight(proposals) * (is_car & moves)
    # Doubt about the ends lasts for a track at rest. For a moving one only the doubt of this frame counts.
    before = tracks.end_variance.T.take(rows, axis=1) * ~moves
    # Where less than half of a car's known width is seen, either end may be the edge of what hides the rest, and the
    # car may lie anywhere beyond. This doubt is of this frame; like all doubt it is bounded by the width seen.
    known_m = widths(tracks.envelope.T.take(rows, axis=1))
    seen_m = widths(kdop)
    is_part = is_car & (seen_m.max(axis=0) < known_m.max(axis=0) / 2)
    unseen_m = np.maximum(known_m - seen_m, 0.0) * is_part
    before = np.maximum(before, np.square(kernels.shape_tuning.disagreement * unseen_m))
    shift, covariance, end_variance = kernels.measured(mean, kdop, sight, variance, before)
    position = x + shift
    # Arms, legs and wheels reach out in turn, while the centroid goes with the body.
    people = IS_PERSON[tracks.object_class[rows]].nonzero()[0]
    step = observations.centroid[proposals[people]] - tracks.centroid[rows[people]]
    position[people] = tracks.kdop_position[rows[people]] + step
    return Matches(rows, proposals, position, covariance, end_variance.T)


def remeasured_hosts(tracks: TrackTable, frame: Associated, kernels: GeometryKernels, variance: float) -> Matches:
    """The matches of a frame. A joined proposal, all parts included, measures the position of its track."""
    matches = frame.matches
    joined = np.isin(matches.rows, frame.joined).nonzero()[0]
    rows = matches.rows[joined]
    whole = measured(tracks, frame.observations, rows, matches.proposals[joined], kernels, variance)
    return matches._replace(
        position=with_rows(matches.position, joined, whole.position),
        covariance=with_rows(matches.covariance, joined, whole.covariance),
        end_variance=with_rows(matches.end_variance, joined, whole.end_variance),
    )


def _free(index: Int, taken: Int, n: int) -> Bool:
    """(K,) which of the indices, each below n, were not taken."""
    occupied = np.zeros(n, np.bool_)
    occupied[taken] = True
    return ~occupied[index]
