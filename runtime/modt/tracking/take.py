"""Take: a senior track takes the larger part of its object from a junior track, which gets the other part."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import MAX_SIZE_M
from modt.observations import Observations
from modt.tracking.pairs import Assignment, Pairs, fit_together
from modt.tracking.track_table import TrackTable
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


def find_takes(tracks: TrackTable, observations: Observations, pairs: Pairs, assignment: Assignment) -> Takes:
    """Exchanges by which senior tracks get larger parts that fit into one object with the box known of them.

    The most senior track chooses first. A track that has changed its proposal keeps the new one.
    """
    size = np.zeros(len(tracks), np.int64)
    held = (assignment.proposal_of_track != NONE).nonzero()[0]
    size[held] = observations.count[assignment.proposal_of_track[held]]
    larger = (pairs.free & (observations.count[pairs.proposals] > size[pairs.rows])).nonzero()[0]
    rows = pairs.rows[larger]
    proposals = pairs.proposals[larger]
    known = tracks.box.take(rows, axis=0)  # where the filter expects it now
    known[:, :2] += tracks.x.take(rows, axis=0)[:, :2] - tracks.anchor.take(rows, axis=0)
    limits = MAX_SIZE_M[tracks.object_class[rows]]
    fits = fit_together(known, observations.box.take(proposals, axis=0), limits)

    proposal_after: dict[int, int] = {}  # by track
    track_after: dict[int, int] = {}  # by proposal
    for row, proposal in zip(rows[fits].tolist(), proposals[fits].tolist(), strict=True):
        junior = track_after.get(proposal, int(assignment.track_of_proposal[proposal]))
        if row in proposal_after or junior in proposal_after:
            continue
        given_up = int(assignment.proposal_of_track[row])
        proposal_after[row] = proposal
        track_after[proposal] = row
        if junior != NONE:
            proposal_after[junior] = given_up
        if given_up != NONE:
            track_after[given_up] = junior
    return Takes(np.array([*proposal_after], np.int64), np.array([*proposal_after.values()], np.int64))
