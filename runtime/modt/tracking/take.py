"""Take: a senior track takes the larger part of its object from a junior track, which gets the other part."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import MAX_SIZE_M
from modt.tracking.pairs import Assignment, Situation, fit_together
from modt.types import NONE, Int


class Takes(NamedTuple):
    """Tracks that exchange their proposals."""

    rows: Int  # (T,) tracks, each once
    proposals: Int  # (T,) proposal that each has afterwards, NONE for none

    def applied(self, assignment: Assignment) -> Assignment:
        """The assignment after the exchange."""
        if not len(self.rows):
            return assignment
        proposal_of_track = assignment.proposal_of_track.copy()
        proposal_of_track[self.rows] = self.proposals
        track_of_proposal = np.full(len(assignment.track_of_proposal), NONE)
        rows = (proposal_of_track != NONE).nonzero()[0]
        track_of_proposal[proposal_of_track[rows]] = rows
        return Assignment(proposal_of_track, track_of_proposal)


def find_takes(now: Situation) -> Takes:
    """Exchanges by which senior tracks get larger parts that fit into one object with the box known of them.

    The most senior track chooses first. A track that has changed its proposal keeps the new one.
    """
    tracks = now.tracks
    pairs = now.pairs
    proposal_of_track, track_of_proposal = now.assignment
    count = now.observations.count
    size = np.zeros(len(tracks), np.int64)
    held = (proposal_of_track != NONE).nonzero()[0]
    size[held] = count[proposal_of_track[held]]
    larger = (pairs.free & (count[pairs.proposals] > size[pairs.rows])).nonzero()[0]
    rows = pairs.rows[larger]
    proposals = pairs.proposals[larger]
    known = tracks.box.take(rows, axis=0)  # where the filter expects it now
    known[:, :2] += tracks.x.take(rows, axis=0)[:, :2] - tracks.kdop_position.take(rows, axis=0)
    seen = now.observations.box.take(proposals, axis=0)
    fits = fit_together(known, seen, MAX_SIZE_M.take(tracks.object_class[rows], axis=0)).nonzero()[0]
    return _exchanges(rows[fits].tolist(), proposals[fits].tolist(), proposal_of_track, track_of_proposal)


def _exchanges(rows: list[int], proposals: list[int], proposal_of_track: Int, track_of_proposal: Int) -> Takes:
    """Exchanges of pairs that are considered in this order, each with what the ones before have changed."""
    proposal_after: dict[int, int] = {}  # by track
    track_after: dict[int, int] = {}  # by proposal
    for row, proposal in zip(rows, proposals, strict=True):
        junior = track_after.get(proposal, int(track_of_proposal[proposal]))
        if row in proposal_after or junior in proposal_after:
            continue
        given_up = int(proposal_of_track[row])
        proposal_after[row] = proposal
        track_after[proposal] = row
        if junior != NONE:
            proposal_after[junior] = given_up
        if given_up != NONE:
            track_after[given_up] = junior
    return Takes(np.array([*proposal_after], np.int64), np.array([*proposal_after.values()], np.int64))
