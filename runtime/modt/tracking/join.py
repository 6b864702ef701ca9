"""Join: parts of a car, or of background that may be one, are joined to the proposal of its track."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_CAR_M, PART_PERSON, USUAL_CAR_M
from modt.classes import ObjectClass
from modt.geometry.kdop import widths
from modt.geometry.kernels import GeometryKernels
from modt.observations import Observations
from modt.tracking.pairs import Assignment, Pairs, first_of_each, fit_together, holds_of
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import RegroupingTuning
from modt.types import NONE, Int


class Joins(NamedTuple):
    """Proposals that become parts of others."""

    parts: Int  # (J,) proposals that are joined, ascending; none of them is a host
    hosts: Int  # (J,) proposal that each is joined to; every host has a track


def find_joins(
    tracks: TrackTable,
    observations: Observations,
    pairs: Pairs,
    assignment: Assignment,
    kernels: GeometryKernels,
    tuning: RegroupingTuning,
) -> Joins:
    """Parts within the known extents of tracks, then parts that come into view beside cars."""
    known = _known_parts(tracks, observations, pairs, assignment, tuning)
    new = _new_parts(tracks, observations, pairs, assignment, kernels, tuning)
    # Who comes first gets the part: the most senior track that knows it, else the last of the cars that it is beside.
    parts = np.concatenate([known.parts, new.parts[::-1]])
    hosts = np.concatenate([known.hosts, new.hosts[::-1]])
    n = len(observations)
    first = first_of_each(parts, n)
    parts = parts[first]
    hosts = hosts[first]
    gains = np.zeros(n, np.bool_)
    gains[hosts] = True
    kept = ~gains[parts]  # a proposal that gains a part is no part itself
    return Joins(parts[kept], hosts[kept])


def _known_parts(
    tracks: TrackTable, observations: Observations, pairs: Pairs, assignment: Assignment, tuning: RegroupingTuning
) -> Joins:
    """Proposals within the known extent of an established track, with that of the track; the most senior first."""
    host = assignment.proposal_of_track[pairs.rows]
    joins = pairs.free & (pairs.within > tuning.min_part_coverage) & (host != NONE) & (host != pairs.proposals)
    joins &= (tracks.hits[pairs.rows] >= tuning.min_hits) & pairs.joinable[pairs.rows]
    joined = joins.nonzero()[0]
    rows = pairs.rows[joined]
    parts = pairs.proposals[joined]
    hosts = host[joined]

    is_car = tracks.object_class == ObjectClass.CAR.value
    known_m = widths(tracks.known_kdops(rows))
    # Background joins parts as a car does, if it is no longer than one, but no person and no part of a car.
    may_be_car = known_m.max(axis=0, initial=0.0) < MAX_CAR_M
    person = PART_PERSON.fits(pairs.extent_m[parts], observations.bottom[parts], observations.top[parts])
    of_car = holds_of(is_car, assignment.track_of_proposal[parts])
    joins = is_car[rows] | (may_be_car & ~person & ~of_car)
    together = np.maximum(observations.kdop.take(parts, axis=1), observations.kdop.take(hosts, axis=1))
    joins &= (widths(together) < known_m + tuning.longer_m).all(axis=0)
    return Joins(parts[joins], hosts[joins])


def _new_parts(
    tracks: TrackTable,
    observations: Observations,
    pairs: Pairs,
    assignment: Assignment,
    kernels: GeometryKernels,
    tuning: RegroupingTuning,
) -> Joins:
    """Proposals beside a car that fit into one car with all that is known of it, as the car comes into view.

    Such a part belongs to no track, or to a new one of fewer points than the car shows.
    """
    kdop = observations.kdop
    cars = tracks.object_class == ObjectClass.CAR.value
    rows = (cars & (assignment.proposal_of_track != NONE)).nonzero()[0]
    owner = assignment.track_of_proposal
    new = (tracks.hits < tuning.min_hits) & ~IS_PERSON[tracks.object_class]
    parts = ((owner == NONE) | holds_of(new, owner)).nonzero()[0]
    around = kdop.take(assignment.proposal_of_track[rows], axis=1) + tuning.beside_m
    i, j = kernels.overlapping_pairs(around, kdop.take(parts, axis=1))
    rows = rows[i]
    parts = parts[j]
    hosts = assignment.proposal_of_track[rows]
    fewer = (owner[parts] == NONE) | (observations.count[parts] < observations.count[hosts])
    together = np.maximum(tracks.known_kdops(rows), kdop.take(parts, axis=1))
    beside = (hosts != parts) & fewer & (widths(together).max(axis=0) < USUAL_CAR_M[0])
    hosts = hosts[beside]
    parts = parts[beside]
    if not len(parts):
        return Joins(parts, hosts)
    box = observations.box
    fit = fit_together(box.take(hosts, axis=0), box.take(parts, axis=0), np.array([USUAL_CAR_M]))
    fit &= ~PART_PERSON.fits(pairs.extent_m[parts], observations.bottom[parts], observations.top[parts])
    return Joins(parts[fit], hosts[fit])
