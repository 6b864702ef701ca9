"""Split: the track of an object that is expected within a longer proposal takes the points where it is expected."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import MAX_SIZE_M
from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS, widths
from modt.tracking.association import UNMEASURED_M2, Matches
from modt.tracking.pairs import Situation, first_of_each, with_rows
from modt.types import NONE, Bool, Float64, Int

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


def find_splits(now: Situation) -> Splits:
    """Pieces for the tracks seen a frame ago that have no proposal, or an odd one."""
    rows, hosts = _hosts(now)
    if not len(rows):
        return NO_SPLITS
    points = _expected_points(now, rows, hosts)
    made = _worth_making(now, points, rows, hosts)
    split = made[points.piece]
    number = made.cumsum() - 1
    return Splits(rows[made], hosts[made], points.members[split], number[points.piece[split]])


def _hosts(now: Situation) -> tuple[Int, Int]:
    """Tracks (R,) that seek a piece, and the longer proposal (R,) that covers most of where each is expected."""
    pairs = now.pairs
    seeks = _seeking(now)
    covered = (seeks[pairs.rows] & (pairs.around > now.tuning.min_coverage)).nonzero()[0]
    if not len(covered):
        return covered, covered
    covered = covered[pairs.around[covered].argsort(kind="stable")][::-1]  # the best first
    rows = pairs.rows[covered]
    hosts = pairs.proposals[covered]
    expected_m = widths(pairs.expected.take(rows, axis=1)).max(axis=0)
    longer = (pairs.extent_m[hosts] > expected_m + now.tuning.longer_m).nonzero()[0]
    best = longer[first_of_each(rows[longer], len(now.tracks))]
    return rows[best], hosts[best]


def _seeking(now: Situation) -> Bool:
    """(M,) objects seen a frame ago that have no proposal, or, if they likely are of their class, an odd one.

    A proposal is odd that is too long for the class of its track, or of few points.
    """
    tracks = now.tracks
    seeks: Bool = (tracks.missed == 0) & (tracks.object_class != ObjectClass.BACKGROUND.value)
    held = (seeks & (now.assignment.proposal_of_track != NONE)).nonzero()[0]
    class_ = tracks.object_class[held]
    proposal = now.assignment.proposal_of_track[held]
    too_long = now.pairs.extent_m[proposal] > MAX_SIZE_M[class_, 0]
    few_points = now.observations.count[proposal] < now.tuning.min_share * tracks.points[held]
    likely = tracks.posterior[held, class_] >= now.tuning.min_probability
    seeks[held] = (too_long | few_points) & likely
    return seeks


def _expected_points(now: Situation, rows: Int, hosts: Int) -> _Points:
    """Members of the hosts (R,) that lie where the tracks (R,) are expected; the first of two tracks gets a point."""
    # Each host's members are listed once a piece: `piece` and `member` are parallel.
    proposals = now.proposals
    T_world_sensor = now.placement.T_world_sensor
    margin_m = now.tuning.margin_m
    count = proposals.count[hosts]
    piece = np.arange(len(rows)).repeat(count)
    begin = proposals.offsets[hosts + 1] - count.cumsum()
    member = np.arange(len(piece)) + begin.repeat(count)
    R = T_world_sensor[:3, :3].astype(np.float32)
    xyz = R @ proposals.coordinates.take(member, axis=1) + T_world_sensor[:3, 3:]
    below = (xyz[2] < now.tracks.top[rows[piece]] + margin_m).nonzero()[0]
    member = member[below]
    piece = piece[below]
    xyz = xyz.take(below, axis=1)
    # What the sensor saw as it turned is moved to the stamp, by the place where the track is expected.
    step = now.placement.deskew(now.tracks.x[rows, :2])
    xy = xyz[:2] + step.T.take(piece, axis=1)
    limit = now.pairs.expected.take(rows[piece], axis=1) + margin_m
    within = (DIRECTIONS.T @ xy <= limit).all(axis=0).nonzero()[0]
    members, first = np.unique(member[within], return_index=True)
    chosen = within[first]
    return _Points(members, piece[chosen], xyz[2, chosen])


def _worth_making(now: Situation, points: _Points, rows: Int, hosts: Int) -> Bool:
    """(R,) pieces of enough points that are as high as their tracks, and leave enough of their hosts.

    A track whose proposal is split itself keeps it if the other pieces leave nothing else. So these pieces are given
    up first; then the others, where the rest is still too small.
    """
    tracks = now.tracks
    tuning = now.tuning
    size = np.bincount(points.piece, minlength=len(rows))
    highest_m = np.full(len(rows), -np.inf)
    np.maximum.at(highest_m, points.piece, points.height_m)
    made: Bool = size >= np.maximum(tuning.min_points, tuning.min_share * tracks.points[rows])
    made &= highest_m >= tracks.top[rows] - tuning.max_drop_m
    keeps_host = now.assignment.proposal_of_track[rows] == hosts
    for given_up in (keeps_host, np.ones(len(rows), np.bool_)):
        rest = now.proposals.count - np.bincount(hosts, size * made, len(now.proposals))
        made &= ~given_up | (rest[hosts] >= tuning.min_points)
    return made


def locate_pieces(
    now: Situation, rows: Int, kdop: Float64, matches: Matches, variance: float
) -> tuple[Float64, Matches]:
    """Positions that pieces measure: k-DOPs (8, S) of the tracks there, and the matches with these positions.

    A piece shows where its track is, by the ends at which nothing touches it, and nothing new of its shape.

    Args:
        now: situation before the edits.
        rows: (S,) tracks of the pieces, each matched.
        kdop: (8, S) k-DOPs of the pieces [m, world].
        matches: the frame's, which number the pieces.
        variance: square of the deviation of a measured position [m2].
    """
    tracks = now.tracks
    expected = tracks.predicted_kdops(rows)
    mean = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ tracks.x.take(rows, axis=0)[:, :2].T
    # An end that is touched is as far from its expected place as the opposite one, and unknown if both are.
    touched = kdop > expected + (now.tuning.margin_m - now.tuning.touch_m)
    both = touched & touched[OPPOSITE]
    off = kdop - mean
    off = np.where(both, 0.0, np.where(touched, -off[OPPOSITE], off))
    before = tracks.end_variance.T.take(rows, axis=1) + both[:4] * UNMEASURED_M2
    shift, covariance, end_variance = now.kernels.measured(mean, mean + off, variance, before)
    at = (matches.rows == rows[:, None]).argmax(axis=1)
    measured = matches._replace(
        position=with_rows(matches.position, at, matches.position[at] + shift),
        covariance=with_rows(matches.covariance, at, covariance),
        end_variance=with_rows(matches.end_variance, at, end_variance.T),
    )
    at_measured: Float64 = expected + DIRECTIONS.T @ shift.T
    return at_measured, measured
