"""Split: the track of an object that is expected within a longer proposal takes the points where it is expected."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import MAX_SIZE_M
from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS, widths
from modt.geometry.kernels import GeometryKernels
from modt.observations import Observations
from modt.placement import Placement
from modt.tracking.association import UNMEASURED_M2, Associated, Matches
from modt.tracking.pairs import Assignment, Pairs, first_of_each
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import RegroupingTuning
from modt.types import NONE, Bool, Float64, Int, Proposals

OPPOSITE = np.roll(np.arange(8), 4)
"""Direction of a k-DOP that is opposite to each."""


class Splits(NamedTuple):
    """Pieces that are split off longer proposals, each for a track."""

    rows: Int  # (S,) track of each piece, ascending
    hosts: Int  # (S,) proposal that it is split off
    members: Int  # (K,) members of the frame that are split off, ascending
    piece: Int  # (K,) piece of each of these


NO_SPLITS = Splits(*np.zeros((4, 0), np.int64))


class _Points(NamedTuple):
    """Points of the longer proposals that lie where a track is expected."""

    members: Int  # (K,) ascending
    piece: Int  # (K,) piece that each would belong to
    height_m: Float64  # (K,) z of each [m, world]


def find_splits(
    tracks: TrackTable,
    frame: Associated,
    placement: Placement,
    pairs: Pairs,
    assignment: Assignment,
    tuning: RegroupingTuning,
) -> Splits:
    """Pieces for the tracks seen a frame ago that have no proposal, or an odd one."""
    rows, hosts = _hosts(tracks, frame.observations, pairs, assignment, tuning)
    if not len(rows):
        return NO_SPLITS
    points = _expected_points(tracks, frame.proposals, placement, pairs, rows, hosts, tuning)
    keeps_host = assignment.proposal_of_track[rows] == hosts
    made = _worth_making(tracks, frame.proposals, points, rows, hosts, keeps_host, tuning)
    split = made[points.piece]
    number = made.cumsum() - 1
    return Splits(rows[made], hosts[made], points.members[split], number[points.piece[split]])


def _hosts(
    tracks: TrackTable, observations: Observations, pairs: Pairs, assignment: Assignment, tuning: RegroupingTuning
) -> tuple[Int, Int]:
    """Tracks (R,) that seek a piece, and the longer proposal (R,) that covers most of where each is expected."""
    seeks = _seeking(tracks, observations, pairs, assignment, tuning)
    covered = (seeks[pairs.rows] & (pairs.around > tuning.min_coverage)).nonzero()[0]
    if not len(covered):
        return covered, covered
    covered = covered[pairs.around[covered].argsort(kind="stable")][::-1]  # the best first
    rows = pairs.rows[covered]
    hosts = pairs.proposals[covered]
    expected_m = widths(pairs.expected.take(rows, axis=1)).max(axis=0)
    longer = (pairs.extent_m[hosts] > expected_m + tuning.longer_m).nonzero()[0]
    best = longer[first_of_each(rows[longer], len(tracks))]
    return rows[best], hosts[best]


def _seeking(
    tracks: TrackTable, observations: Observations, pairs: Pairs, assignment: Assignment, tuning: RegroupingTuning
) -> Bool:
    """(M,) objects seen a frame ago that have no proposal, or, if they likely are of their class, an odd one.

    A proposal is odd that is too long for the class of its track, or of few points.
    """
    seeks: Bool = (tracks.missed == 0) & (tracks.object_class != ObjectClass.BACKGROUND.value)
    held = (seeks & (assignment.proposal_of_track != NONE)).nonzero()[0]
    class_ = tracks.object_class[held]
    proposal = assignment.proposal_of_track[held]
    too_long = pairs.extent_m[proposal] > MAX_SIZE_M[class_, 0]
    few_points = observations.count[proposal] < tuning.min_share * tracks.points[held]
    likely = tracks.posterior[held, class_] >= tuning.min_probability
    seeks[held] = (too_long | few_points) & likely
    return seeks


def _expected_points(
    tracks: TrackTable,
    proposals: Proposals,
    placement: Placement,
    pairs: Pairs,
    rows: Int,
    hosts: Int,
    tuning: RegroupingTuning,
) -> _Points:
    """Members of the hosts (R,) that lie where the tracks (R,) are expected; the first of two tracks gets a point."""
    # Each host's members are listed once a piece: `piece` and `member` are parallel.
    count = proposals.count[hosts]
    piece = np.arange(len(rows)).repeat(count)
    begin = proposals.offsets[hosts + 1] - count.cumsum()
    member = np.arange(len(piece)) + begin.repeat(count)
    R = placement.T_world_sensor[:3, :3].astype(np.float32)
    xyz = R @ proposals.coordinates.take(member, axis=1) + placement.T_world_sensor[:3, 3:]
    below = (xyz[2] < tracks.top[rows][piece] + tuning.margin_m).nonzero()[0]
    member = member[below]
    piece = piece[below]
    xyz = xyz.take(below, axis=1)
    # What the sensor saw as it turned is moved to the stamp, by the place where the track is expected.
    step = placement.deskew(tracks.x.take(rows, axis=0)[:, :2])
    xy = xyz[:2] + step.T.take(piece, axis=1)
    limit = pairs.expected.take(rows[piece], axis=1) + tuning.margin_m
    within = (DIRECTIONS.T @ xy <= limit).all(axis=0).nonzero()[0]
    members, first = np.unique(member[within], return_index=True)
    chosen = within[first]
    return _Points(members, piece[chosen], xyz[2, chosen])


def _worth_making(
    tracks: TrackTable,
    proposals: Proposals,
    points: _Points,
    rows: Int,
    hosts: Int,
    keeps_host: Bool,
    tuning: RegroupingTuning,
) -> Bool:
    """(R,) pieces of enough points that are as high as their tracks, and leave enough of their hosts.

    A track whose proposal is split itself (R,) keeps it if the other pieces leave nothing else. So these pieces are
    given up first; then the others, where the rest is still too small.
    """
    size = np.bincount(points.piece, minlength=len(rows))
    highest_m = np.full(len(rows), -np.inf)
    np.maximum.at(highest_m, points.piece, points.height_m)
    made: Bool = size >= np.maximum(tuning.min_points, tuning.min_share * tracks.points[rows])
    made &= highest_m >= tracks.top[rows] - tuning.max_drop_m
    made &= ~keeps_host | (_rest(proposals, hosts, size * made) >= tuning.min_points)
    made &= _rest(proposals, hosts, size * made) >= tuning.min_points
    return made


def _rest(proposals: Proposals, hosts: Int, taken: Int) -> Int:
    """(R,) points that remain of each host (R,), where as many points are taken by each piece (R,)."""
    rest: Int = proposals.count - np.bincount(hosts, taken, len(proposals))
    return rest[hosts]


def locate_pieces(
    tracks: TrackTable,
    rows: Int,
    kdop: Float64,
    matches: Matches,
    kernels: GeometryKernels,
    sigma_m: float,
    tuning: RegroupingTuning,
) -> tuple[Float64, Matches]:
    """Positions that pieces measure: k-DOPs (8, S) of the tracks there, and the matches with these positions.

    A piece shows where its track is, by the ends at which nothing touches it, and nothing new of its shape.

    Args:
        tracks: as predicted.
        rows: (S,) tracks of the pieces, each matched.
        kdop: (8, S) k-DOPs of the pieces [m, world].
        matches: of the frame.
        kernels: passes over pairs.
        sigma_m: standard deviation of a measured position [m].
        tuning: margin around the expected extent.
    """
    expected = tracks.predicted_kdops(rows)
    mean = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ tracks.x.take(rows, axis=0)[:, :2].T
    # An end that is touched is as far from its expected place as the opposite one, and unknown if both are.
    touched = kdop > expected + (tuning.margin_m - tuning.touch_m)
    both = touched & touched[OPPOSITE]
    shift_of_end = kdop - mean
    shift_of_end = np.where(touched, -shift_of_end[OPPOSITE], shift_of_end)
    shift_of_end = np.where(both, 0.0, shift_of_end)
    before = tracks.end_variance.T.take(rows, axis=1) + both[:4] * UNMEASURED_M2
    shift, covariance, end_variance = kernels.measured(mean, mean + shift_of_end, sigma_m**2, before)

    at = (matches.rows == rows[:, None]).argmax(axis=1)
    position = matches.position.copy()
    position[at] += shift
    covariances = matches.covariance.copy()
    covariances[at] = covariance
    end_variances = matches.end_variance.copy()
    end_variances[at] = end_variance.T
    at_measured: Float64 = expected + DIRECTIONS.T @ shift.T
    return at_measured, matches._replace(position=position, covariance=covariances, end_variance=end_variances)
