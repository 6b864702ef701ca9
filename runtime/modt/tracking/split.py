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
    member_rows: Int  # (K,) rows of Proposals.members that are split off, ascending
    piece: Int  # (K,) piece of each of these


NO_SPLITS = Splits(*np.zeros((4, 0), np.int64))


class _Points(NamedTuple):
    """Points of the longer proposals that lie where a track is expected."""

    member_rows: Int  # (K,) rows of Proposals.members, ascending, each once
    piece: Int  # (K,) piece that each would belong to
    height_m: Float64  # (K,) z of each [m, world]


def find_splits(now: Situation) -> Splits:
    """Pieces for the object tracks seen in the last frame that have no proposal, or a doubtful one.

    A track that was observed once gets none, since it has no pairs (`Pairs`).
    """
    rows, hosts = _hosts(now)
    if not len(rows):
        return NO_SPLITS
    # Each point is given to one piece first. A piece that is not made leaves its points to the host, not to a rival.
    points = _expected_points(now, rows, hosts)
    made = _worth_making(now, points, rows, hosts)
    split = made[points.piece]
    number = made.cumsum() - 1
    return Splits(rows[made], hosts[made], points.member_rows[split], number[points.piece[split]])


def _hosts(now: Situation) -> tuple[Int, Int]:
    """Tracks (R,), ascending, that seek a piece, and the longer proposal (R,) that covers most of each."""
    pairs = now.pairs
    seeks = _seeking(now)
    covered = (seeks[pairs.rows] & (pairs.around > now.tuning.min_coverage)).nonzero()[0]
    if not len(covered):
        return covered, covered
    covered = covered[pairs.around[covered].argsort(kind="stable")][::-1]  # the best first
    rows = pairs.rows[covered]
    hosts = pairs.proposals[covered]
    expected_m = widths(pairs.expected.take(rows, axis=1)).max(axis=0)
    longer = (pairs.max_width_m[hosts] > expected_m + now.tuning.max_excess_m).nonzero()[0]
    best = longer[first_of_each(rows[longer], len(now.tracks))]
    return rows[best], hosts[best]


def _seeking(now: Situation) -> Bool:
    """(M,) object tracks seen in the last frame that have no proposal, or a doubtful one.

    A proposal is doubtful if it is too long for the class of its track, or has few points. A doubtful one counts only
    if the class is probable.
    """
    tracks = now.tracks
    seeks: Bool = (tracks.missed == 0) & (tracks.object_class != ObjectClass.BACKGROUND.value)
    held = (seeks & (now.assignment.proposal_of_track != NONE)).nonzero()[0]
    class_ = tracks.object_class[held]
    proposal = now.assignment.proposal_of_track[held]
    too_long = now.pairs.max_width_m[proposal] > MAX_SIZE_M[class_, 0]
    few_points = now.observations.count[proposal] < now.tuning.min_share * tracks.points[held]
    likely = tracks.posterior[held, class_] >= now.tuning.min_probability
    seeks[held] = (too_long | few_points) & likely
    return seeks


def _expected_points(now: Situation, rows: Int, hosts: Int) -> _Points:
    """Members of the hosts (R,) that lie where the tracks (R,), ascending, are expected.

    A point where two are expected goes to the track of the lower row, which is the older one, not always the senior.
    """
    offsets = now.proposals.offsets
    T_world_sensor = now.placement.T_world_sensor
    R = T_world_sensor[:3, :3].astype(np.float32)
    margin_m = now.tuning.margin_m
    top_m = now.tracks.top[rows] + margin_m
    ends_m = now.pairs.expected.take(rows, axis=1) + margin_m
    # Points are deskewed to the stamp as if seen where the track is expected.
    step = now.placement.deskew(now.tracks.x[rows, :2])
    member_rows = []
    height_m = []
    for piece, host in enumerate(hosts):
        first = offsets[host]
        xyz = R @ now.proposals.coordinates[:, first : offsets[host + 1]] + T_world_sensor[:3, 3:]
        xy = xyz[:2] + step[piece, :, None]
        within = (DIRECTIONS.T @ xy <= ends_m[:, piece, None]).all(axis=0) & (xyz[2] < top_m[piece])
        member_rows.append(first + within.nonzero()[0])
        height_m.append(xyz[2, within])
    piece_of_point = np.arange(len(rows)).repeat(list(map(len, member_rows)))
    once, chosen = np.unique(np.concatenate(member_rows), return_index=True)
    return _Points(once, piece_of_point[chosen], np.concatenate(height_m)[chosen])


def _worth_making(now: Situation, points: _Points, rows: Int, hosts: Int) -> Bool:
    """(R,) pieces of enough points that are as high as their tracks, and leave enough of their hosts.

    If too few points would remain in a host, the piece of the track that owns the host is dropped first. If they are
    too few after that, all its other pieces are dropped.
    """
    tracks = now.tracks
    tuning = now.tuning
    size = np.bincount(points.piece, minlength=len(rows))
    highest_m = np.full(len(rows), -np.inf)
    np.maximum.at(highest_m, points.piece, points.height_m)
    made: Bool = size >= np.maximum(tuning.min_points, tuning.min_share * tracks.points[rows])
    made &= highest_m >= tracks.top[rows] - tuning.max_drop_m
    is_own_host = now.assignment.proposal_of_track[rows] == hosts
    for given_up in (is_own_host, np.ones(len(rows), np.bool_)):
        rest = now.proposals.count - np.bincount(hosts, size * made, len(now.proposals))
        made &= ~given_up | (rest[hosts] >= tuning.min_points)
    return made


def locate_pieces(
    now: Situation, rows: Int, kdop: Float64, matches: Matches, variance: float
) -> tuple[Float64, Matches]:
    """Positions that pieces measure: k-DOPs (8, S) of the tracks there, and the matches with these positions.

    A piece measures the position of its track by the ends that nothing touches. The shape of the track stays.

    Args:
        now: situation after the takes, before joins and splits.
        rows: (S,) tracks of the pieces.
        kdop: (8, S) k-DOPs of the pieces [m, world].
        matches: matches after all edits, in which each of these tracks has its piece, and its expected position.
        variance: square of the deviation of a measured position [m2].
    """
    tracks = now.tracks
    expected = tracks.predicted_kdops(rows)
    mean = tracks.mean_kdop.T.take(rows, axis=1) + DIRECTIONS.T @ tracks.x.take(rows, axis=0)[:, :2].T
    # A touched end takes the displacement of the opposite end. If both are touched, the axis is known weakly: its
    # variance is the greatest that `measured` allows for the width of the object.
    touched = kdop > expected + (now.tuning.margin_m - now.tuning.touch_m)
    both = touched & touched[OPPOSITE]
    off = kdop - mean
    off = np.where(both, 0.0, np.where(touched, -off[OPPOSITE], off))
    end_variance_before = tracks.end_variance.T.take(rows, axis=1) + both[:4] * UNMEASURED_M2
    shift, covariance, end_variance = now.kernels.measured(
        mean, mean + off, np.zeros((2, len(rows))), variance, end_variance_before
    )
    match_of_piece = (matches.rows == rows[:, None]).argmax(axis=1)
    # The pieces are new to their tracks, so the matches hold the expected positions, from which the shift leads.
    measured = matches._replace(
        position=with_rows(matches.position, match_of_piece, matches.position[match_of_piece] + shift),
        covariance=with_rows(matches.covariance, match_of_piece, covariance),
        end_variance=with_rows(matches.end_variance, match_of_piece, end_variance.T),
    )
    kdop_there: Float64 = expected + DIRECTIONS.T @ shift.T
    return kdop_there, measured
