"""Pairs of a track and a proposal within its known extent, and who may take which proposal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import IS_PERSON, IS_WALKER
from modt.geometry.kdop import widths
from modt.geometry.kernels import GeometryKernels
from modt.observations import Observations
from modt.placement import Placement
from modt.tracking.association import Associated, Matches
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import RegroupingTuning
from modt.types import NONE, Bool, Float64, Int, Proposals


class Assignment(NamedTuple):
    """One-to-one assignment of tracks and proposals; either may have no partner."""

    proposal_of_track: Int  # (M,) proposal of each track, NONE where it has none
    track_of_proposal: Int  # (P,) row of the track of each proposal, NONE where it has none

    @classmethod
    def of(cls, matches: Matches, n_tracks: int, n_proposals: int) -> Assignment:
        """The assignment by matches."""
        assignment = cls(np.full(n_tracks, NONE), np.full(n_proposals, NONE))
        assignment.proposal_of_track[matches.rows] = matches.proposals
        assignment.track_of_proposal[matches.proposals] = matches.rows
        return assignment


class Pairs(NamedTuple):
    """Tracks and the proposals that overlap their known extents, by falling seniority of the tracks.

    Only tracks that were observed twice or more are listed. With them, facts of all tracks (M,) and proposals (P,)
    that several steps need. `free` follows from the assignment before takes; joins use it beside the one after them.
    """

    rows: Int  # (K,) track of each pair
    proposals: Int  # (K,) proposal of each pair
    within: Float64  # (K,) share of the proposal's area inside the known extent
    around: Float64  # (K,) share of the expected track's area inside the proposal
    free: Bool  # (K,) the track may take the proposal, and one covers enough of the other (min_coverage)
    joinable: Bool  # (M,) tracks that may gain parts: all but pedestrians, and those whose upper half is cut off
    expected: Float64  # (8, M) k-DOPs of the tracks, where the filter expects them
    max_width_m: Float64  # (P,) greatest width of the k-DOP of each proposal


class Situation(NamedTuple):
    """A frame after association, with all that the edits are found from."""

    tracks: TrackTable  # as predicted
    proposals: Proposals
    observations: Observations  # the proposals in the world
    placement: Placement  # of the frame in the world
    assignment: Assignment
    pairs: Pairs
    kernels: GeometryKernels
    tuning: RegroupingTuning

    @classmethod
    def of(
        cls,
        tracks: TrackTable,
        frame: Associated,
        placement: Placement,
        kernels: GeometryKernels,
        tuning: RegroupingTuning,
    ) -> Situation:
        """The situation of a frame, with its pairs."""
        proposals, observations, matches, _ = frame
        assignment = Assignment.of(matches, len(tracks), len(proposals))
        pairs = _listed(tracks, observations, assignment, kernels, tuning.min_coverage)
        return cls(tracks, proposals, observations, placement, assignment, pairs, kernels, tuning)


def _listed(
    tracks: TrackTable,
    observations: Observations,
    assignment: Assignment,
    kernels: GeometryKernels,
    min_coverage: float,
) -> Pairs:
    """Pairs of the tracks that were observed twice or more."""
    # Senior is the track of which more points were seen: frames with a proposal times points of the last one. Of two
    # alike it is the one that comes first in the table.
    by_seniority = (-tracks.hits * tracks.points).argsort(kind="stable")
    rank = np.empty(len(tracks), np.int64)
    rank[by_seniority] = np.arange(len(tracks))
    listed = by_seniority[tracks.hits[by_seniority] > 1]

    known = tracks.known_kdops(listed)
    expected = tracks.predicted_kdops()
    which, proposals = kernels.overlapping_pairs(known, observations.kdop)
    rows = listed[which]
    joinable = ~IS_WALKER[tracks.object_class] | tracks.top_cut
    within = kernels.coverage(observations.kdop, known, proposals, which)
    around = kernels.coverage(expected, observations.kdop, rows, proposals)
    free = np.maximum(within, around) > min_coverage
    owner = assignment.track_of_proposal[proposals]
    owned = (owner != NONE).nonzero()[0]
    free[owned] &= _may_take(tracks, rank, joinable, rows[owned], owner[owned])
    max_width_m = widths(observations.kdop).max(axis=0)
    return Pairs(rows, proposals, within, around, free, joinable, expected, max_width_m)


def _may_take(tracks: TrackTable, rank: Int, joinable: Bool, rows: Int, owners: Int) -> Bool:
    """(k,) tracks that may take a proposal of its owner: their own, or that of a junior track of a like class.

    Background and cars are easily confused, so they count as alike. A cyclist may take either, and so may a
    pedestrian of whom only the legs are seen, since a wheel or legs alone may be taken for either. People are taken
    by their own class alone.
    """
    alike = tracks.object_class[rows] == tracks.object_class[owners]
    alike |= joinable[rows] & ~IS_PERSON[tracks.object_class[owners]]
    may_take: Bool = (owners == rows) | ((rank[owners] > rank[rows]) & alike)
    return may_take


def mask_at(mask: Bool, rows: Int) -> Bool:
    """(K,) mask[rows] for a mask (M,) and (K,) rows; False where a row is NONE."""
    is_set: Bool = rows != NONE
    is_set[is_set] = mask[rows[is_set]]
    return is_set


def first_of_each(group: Int, n_groups: int) -> Int:
    """Index of the first entry of each group that occurs, by rising group, given (K,) groups below n_groups."""
    first = np.full(n_groups, len(group))
    np.minimum.at(first, group, np.arange(len(group)))
    return first[first < len(group)]


def with_rows(column: Float64, rows: Int, entries: Float64 | float) -> Float64:
    """A copy of a column with other entries in these rows."""
    copied = column.copy()
    copied[rows] = entries
    return copied


def fit_together(a: Float64, b: Float64, size: Float64) -> Bool:
    """(k,) whether boxes a and b (k, 7) fit into one of size (k, 2) or (1, 2), along the heading of the longer."""
    # A contiguous row a column is several times faster for a few boxes.
    a = a.T.copy()
    b = b.T.copy()
    a_is_longer = a[3] > b[3]
    longer = np.where(a_is_longer, a, b)
    other = np.where(a_is_longer, b, a)
    x, y = other[:2] - longer[:2]
    yaw = longer[6]
    cosine = np.cos(yaw)
    sine = np.sin(yaw)
    offset = np.array((x * cosine + y * sine, y * cosine - x * sine))
    # Half the extent of the other along the heading of the longer one, and across.
    length, width = other[3:5] / 2
    turn = yaw - other[6]
    cosine = np.abs(np.cos(turn))
    sine = np.abs(np.sin(turn))
    reach = np.array((length * cosine + width * sine, length * sine + width * cosine))
    half = longer[3:5] / 2
    one, two = np.maximum(half, offset + reach) - np.minimum(-half, offset - reach)
    fit: Bool = (np.maximum(one, two) < size[:, 0]) & (np.minimum(one, two) < size[:, 1])
    return fit
