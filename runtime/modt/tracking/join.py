"""Join: parts of an object are joined to the proposal of its track.

The object is a car, a cyclist, background that may be a car, or a person of whom the view shows only the legs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.class_sizes import HAS_PARTS, IS_PERSON, IS_RIDER, IS_VEHICLE, MAX_CAR_M, PART_PERSON, WHOLE_SIZE_M
from modt.geometry.kdop import widths
from modt.tracking.pairs import Situation, first_of_each, fit_together, mask_at
from modt.types import NONE, Bool, Int


class Joins(NamedTuple):
    """Proposals that become parts of others."""

    parts: Int  # (J,) proposals that are joined, ascending; none of them is a host
    hosts: Int  # (J,) proposal that each is joined to; every host has a track


def find_joins(now: Situation) -> Joins:
    """Parts within the known extents of tracks, then parts that come into view beside cars and cyclists."""
    known = _known_parts(now)
    new = _new_parts(now)
    # Priority of hosts: the most senior track that knows the part, else the last track beside it in the table. The
    # latter choice is arbitrary.
    parts = np.concatenate([known.parts, new.parts[::-1]])
    hosts = np.concatenate([known.hosts, new.hosts[::-1]])
    first = first_of_each(parts, len(now.proposals))
    parts = parts[first]
    hosts = hosts[first]
    gains = np.zeros(len(now.proposals), np.bool_)
    gains[hosts] = True
    kept = ~gains[parts]  # a proposal that gains a part is no part itself
    return Joins(parts[kept], hosts[kept])


def _known_parts(now: Situation) -> Joins:
    """Proposals within the known extent of an established track, each with the proposal of that track.

    Those of the most senior track come first.
    """
    tracks = now.tracks
    pairs = now.pairs
    host = now.assignment.proposal_of_track[pairs.rows]
    candidate = pairs.free & (pairs.within > now.tuning.min_part_coverage)
    candidate &= (host != NONE) & (host != pairs.proposals)
    candidate &= (tracks.hits[pairs.rows] >= now.tuning.min_hits) & pairs.joinable[pairs.rows]
    candidates = candidate.nonzero()[0]
    rows = pairs.rows[candidates]
    parts = pairs.proposals[candidates]
    hosts = host[candidates]

    is_car = IS_VEHICLE[tracks.object_class]
    known_m = widths(tracks.known_kdops(rows))
    may_be_person = _may_be_person(now, parts)
    # A car has parts of every shape, but nobody who is clearly seen above it, as in its open door.
    of_car_host = is_car[rows] & ~(may_be_person & _stands_above(now, parts, hosts))
    # A possible person is joined to cars only. A host that is neither car nor cyclist (background, or a person's
    # legs) must be shorter than a car, and takes no proposal of a car's track.
    may_be_car = known_m.max(axis=0) < MAX_CAR_M
    has_car_track = mask_at(is_car, now.assignment.track_of_proposal[parts])
    of_other_host = ~may_be_person & (IS_RIDER[tracks.object_class[rows]] | (may_be_car & ~has_car_track))
    accepted = of_car_host | of_other_host
    kdop = now.observations.kdop
    together = np.maximum(kdop.take(parts, axis=1), kdop.take(hosts, axis=1))
    accepted &= (widths(together) < known_m + now.tuning.max_excess_m).all(axis=0)
    return Joins(parts[accepted], hosts[accepted])


def _new_parts(now: Situation) -> Joins:
    """Proposals beside a car or a cyclist that fit into one with all that is known of it, as it comes into view.

    Such a part belongs to no track, or to a new one of fewer points than the object shows.
    """
    tracks = now.tracks
    proposal_of_track, owner = now.assignment
    kdop = now.observations.kdop
    count = now.observations.count
    rows = (HAS_PARTS[tracks.object_class] & (proposal_of_track != NONE)).nonzero()[0]
    new = (tracks.hits < now.tuning.min_hits) & ~IS_PERSON[tracks.object_class]
    parts = ((owner == NONE) | mask_at(new, owner)).nonzero()[0]
    around = kdop.take(proposal_of_track[rows], axis=1) + now.tuning.beside_m
    which_row, which_part = now.kernels.overlapping_pairs(around, kdop.take(parts, axis=1))
    rows = rows[which_row]
    parts = parts[which_part]
    hosts = proposal_of_track[rows]
    together = np.maximum(tracks.known_kdops(rows), kdop.take(parts, axis=1))
    beside = (hosts != parts) & ((owner[parts] == NONE) | (count[parts] < count[hosts]))
    size_m = WHOLE_SIZE_M.take(tracks.object_class[rows], axis=0)
    beside &= widths(together).max(axis=0) < size_m[:, 0]
    hosts = hosts[beside]
    parts = parts[beside]
    if not len(parts):
        return Joins(parts, hosts)
    box = now.observations.box
    fit = fit_together(box[hosts], box[parts], size_m[beside]) & ~_may_be_person(now, parts)
    return Joins(parts[fit], hosts[fit])


def _stands_above(now: Situation, parts: Int, hosts: Int) -> Bool:
    """(k,) parts (k,) of enough points that are clearly taller than the proposals of their hosts (k,)."""
    top = now.observations.top
    is_clear: Bool = now.observations.count[parts] >= now.tuning.min_person_points
    return is_clear & (top[parts] > top[hosts] + now.tuning.taller_m)


def _may_be_person(now: Situation, proposals: Int) -> Bool:
    """(k,) proposals that may be a person by their sizes."""
    max_width_m = now.pairs.max_width_m[proposals]
    return PART_PERSON.fits(max_width_m, now.observations.bottom[proposals], now.observations.top[proposals])
