"""Fragments: parts of one object that were segmented apart, and the one track that goes on with it.

A pole before a car, or the edge of a bush, splits it; each part has a track, and the larger part changes between
frames. Two tracks of one class whose boxes fit together into one object of that class, one of them within the
known extent of the other or around it, are one object: the senior track takes the larger part, and the whole when
only one is visible. A part that may be a person, and has an established track, stays with it.

The senior track is that of which more points were seen, not the older one: a fragment begins in the frame in which
its car does, and a bush is older than the car that passes it; neither takes the car from the track that follows it.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_PERSON_M, MAX_SIZE_M
from modt.classes import ObjectClass
from modt.geometry.kdop import coverage
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.tracking.association import Matches
from modt.tracking.track_table import ESTABLISHED_HITS, TrackTable
from modt.types import NONE, Bool, Float64, Int

MIN_COVERAGE = 0.6
"""Least part of one fragment that lies within the known extent of the other."""


class Reunion:
    """Gives the larger part of an object to its most senior track.

    Args:
        kernels: passes over pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels

    def reunite(self, tracks: TrackTable, observations: Observations, matches: Matches) -> Matches:
        """The matches after senior tracks have swapped their proposals for larger parts of their objects."""
        if not len(observations):
            return matches
        proposal_of_track = np.full(len(tracks), NONE, np.int64)
        track_of_proposal = np.full(len(observations), NONE, np.int64)
        proposal_of_track[matches.rows], track_of_proposal[matches.proposals] = matches.proposals, matches.rows
        seen_twice = (tracks.hits > 1).nonzero()[0]
        by_seniority = seen_twice[(-_seniority(tracks)[seen_twice]).argsort(kind="stable")]
        senior, parts = self._parts(tracks, observations, by_seniority, proposal_of_track, track_of_proposal)
        rows, proposals = swap_proposals(senior, parts, proposal_of_track, track_of_proposal)
        return matches.reassigned(tracks, rows, proposals) if len(rows) else matches

    def _parts(
        self, tracks: TrackTable, observations: Observations, row: Int, proposal_of_track: Int, track_of_proposal: Int
    ) -> tuple[Int, Int]:
        """Pairs of a row and a proposal: a track, and a larger part of its object that it is not matched with."""
        if not len(row):
            return row, row
        known = tracks.known_kdops(row)
        i, part = self._kernels.overlapping_pairs(known, observations.kdop)
        senior, other = row[i], track_of_proposal[part]
        seniority = _seniority(tracks)
        size = np.where(proposal_of_track == NONE, 0, observations.count[proposal_of_track])
        junior = (other == NONE) | (seniority[other] < seniority[senior])
        larger = (junior & (other != senior) & (observations.count[part] > size[senior])).nonzero()[0]
        bulky = np.minimum(observations.box[part[larger], 3], tracks.box[senior[larger], 3]) > MAX_PERSON_M
        larger = larger[bulky | _gives_way(tracks, senior[larger], other[larger])]
        i, senior, part = i[larger], senior[larger], part[larger]
        box = tracks.box.take(senior, axis=0)
        box[:, :2] += tracks.x.take(senior, axis=0)[:, :2] - tracks.anchor.take(senior, axis=0)
        related = _fit_together(box, observations.box.take(part, axis=0), MAX_SIZE_M[tracks.last_class[senior]])
        kdop = observations.kdop.take(part, axis=1)
        within = coverage(kdop, known.take(i, axis=1)) > MIN_COVERAGE
        around = coverage(tracks.predicted_kdops(senior), kdop) > MIN_COVERAGE
        related &= (within | around) & _may_be_one_class(tracks, senior, track_of_proposal[part])
        return senior[related], part[related]


def swap_proposals(senior: Int, parts: Int, proposal_of_track: Int, track_of_proposal: Int) -> tuple[Int, Int]:
    """Reassignment: a senior track takes a part and leaves its own proposal to the part's former track, each once.

    Args:
        senior: (K,) rows that may take a part, the first in order served first.
        parts: (K,) proposal that each may take.
        proposal_of_track: (M,) proposal of each track, NONE for none.
        track_of_proposal: (P,) track of each proposal, NONE for none.

    Returns:
        (R,) rows, ascending, and the proposal of each now, NONE for none.
    """
    has: dict[int, int] = {}
    taken: set[int] = set()
    for row, part in zip(senior.tolist(), parts.tolist(), strict=True):
        former = int(track_of_proposal[part])
        if part in taken or row in has or former in has:
            continue
        has[row] = part
        if former != NONE:
            has[former] = int(proposal_of_track[row])
        taken.add(part)
    rows = sorted(has)
    return np.array(rows, np.int64), np.array([has[row] for row in rows], np.int64)


def _gives_way(tracks: TrackTable, senior: Int, other: Int) -> Bool:
    """(k,) whether a part has no established track (other NONE: no track), or the senior track is a car."""
    car: Bool = tracks.last_class[senior] == ObjectClass.CAR.value
    gives_way: Bool = (other == NONE) | (tracks.hits[other] < ESTABLISHED_HITS) | car
    return gives_way


def _seniority(tracks: TrackTable) -> Int:
    """(M,) about as many points as were seen of each track in its life."""
    seniority: Int = tracks.hits * tracks.points
    return seniority


def _may_be_one_class(tracks: TrackTable, senior: Int, other: Int) -> Bool:
    """(k,) whether two tracks (other NONE: no track) may be of one class: background and cars are easily confused."""
    a, b = tracks.last_class[senior], tracks.last_class[other]
    one_class: Bool = (other == NONE) | (a == b) | ~(IS_PERSON[a] | IS_PERSON[b])
    return one_class


def _fit_together(a: Float64, b: Float64, size: Float64) -> Bool:
    """(k,) whether boxes a and b (k, 7) lie within one box of a size (k, 2), along the heading of the longer."""
    yaw = np.where(a[:, 3] > b[:, 3], a[:, 6], b[:, 6])
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = (b[:, :2] - a[:, :2]).T
    offset = np.array((x * c + y * s, y * c - x * s))
    half_a, half_b = (_half_widths(box, yaw) for box in (a, b))
    span = np.maximum(half_a, offset + half_b) - np.minimum(-half_a, offset - half_b)
    fit: Bool = (np.maximum(*span) < size[:, 0]) & (np.minimum(*span) < size[:, 1])
    return fit


def _half_widths(boxes: Float64, yaw: Float64) -> Float64:
    """(2, k) half extent of each box (k, 7) along a heading yaw and across it [m]."""
    (length, width), turn = boxes[:, 3:5].T / 2, yaw - boxes[:, 6]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return np.array((length * c + width * s, length * s + width * c))
