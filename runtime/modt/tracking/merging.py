"""Parts of a car that were segmented apart, merged where its track knows the car as a whole.

A pole before a car, or the edge of a bush, splits it in frame after frame, and neither part looks like a car. What
lies within the known extent of a classified car, beside the proposal matched with it, is merged with that proposal,
unless a classified person or cyclist is matched with it, or an older classified car, or both together exceed the
known extent. Many a car is background as long as it is seen in parts: what is background, and no longer than a car,
is made whole as well, but takes nothing from cars and older tracks, nor what may be a person.

The risk: a person who steps close to a parked car, and is not classified yet, becomes a part of it.
"""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_CAR_M, PART_PERSON
from modt.classes import ObjectClass
from modt.geometry import yaw_of
from modt.geometry.kdop import DIRECTIONS, coverage, widths
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.placement import Placement
from modt.tracking.regrouping import Associated, Grouping, runs_of
from modt.tracking.track_table import ESTABLISHED_HITS, TrackTable
from modt.types import NONE, Bool, Int

MIN_COVERAGE, LONGER_M = 0.7, 0.3
"""Least part of a piece within the known extent of the car; by how much the merged car may exceed that extent."""


class CarMerging:
    """Merges the parts of cars that are known as such, and of background that may be a car.

    Args:
        kernels: passes over points and pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels

    def regroup(self, tracks: TrackTable, frame: Associated, placement: Placement) -> Associated:
        """The frame with one proposal in place of the parts of each car."""
        rows, hosts, parts = self._parts(tracks, frame)
        if not len(parts):
            return frame
        n = len(frame.proposals)
        into, yaw, kept = np.arange(n), np.zeros(n), np.ones(n, np.bool_)
        into[parts], kept[parts] = hosts, False
        yaw[hosts] = tracks.box[rows, 6] - yaw_of(placement.T_world_sensor)  # a part may lie across the car
        source = kept.nonzero()[0]
        number = np.full(n, NONE)
        number[source] = np.arange(len(source))
        count = np.bincount(number[into], frame.proposals.count, len(source)).astype(np.int64)
        runs = frame.proposals.offsets.take(runs_of(into.argsort(kind="stable")))
        whole = np.zeros(len(source), np.bool_)
        whole[number[hosts]] = True
        changed = whole.nonzero()[0]
        grouping = Grouping(runs, count, source, changed, yaw[source[changed]])
        proposals, observations = grouping.apply(frame, placement, self._kernels)
        matched = number[frame.matches.proposals]
        of_kept = (matched != NONE).nonzero()[0]
        return Associated(proposals, observations, frame.matches.take(of_kept, matched[of_kept]))

    def _parts(self, tracks: TrackTable, frame: Associated) -> tuple[Int, Int, Int]:
        """Rows of tracks that merge, the proposal of each, and a further part of it; every part once."""
        matches, kdops = frame.matches, frame.observations.kdop
        cars = (_may_be_car(tracks, matches.rows) & (tracks.hits[matches.rows] >= ESTABLISHED_HITS)).nonzero()[0]
        cars = cars[matches.rows[cars].argsort()]  # the oldest first: tracks are in the order of their birth
        rows, hosts = matches.rows[cars], matches.proposals[cars]
        if not len(rows):
            return rows, hosts, hosts
        known = tracks.envelope.take(rows, axis=0).T + DIRECTIONS.T @ matches.position.take(cars, axis=0).T
        room = (known - kdops.take(hosts, axis=1)).max(axis=0) > LONGER_M
        mergers = (room | _cars(tracks, rows)).nonzero()[0]  # background that reaches its ends lacks no part
        rows, hosts, known = rows[mergers], hosts[mergers], known.take(mergers, axis=1)
        k, parts = self._kernels.overlapping_pairs(known, kdops)
        other = (parts != hosts[k]).nonzero()[0]
        k, parts = k[other], parts[other]
        owner = np.full(kdops.shape[1], NONE)
        owner[matches.proposals] = matches.rows
        part, whole = kdops.take(parts, axis=1), known.take(k, axis=1)
        both = np.maximum(part, kdops.take(hosts[k], axis=1))
        fits = np.flatnonzero((widths(both) < widths(whole) + LONGER_M).all(axis=0))
        fits = fits[coverage(part.take(fits, axis=1), whole.take(fits, axis=1)) > MIN_COVERAGE]
        k, parts = k[fits], parts[fits]
        free = _may_take(tracks, rows[k], owner[parts])
        free &= _cars(tracks, rows[k]) | ~_person_like(frame.observations, parts)
        taker = np.full(len(owner), NONE)
        taker[parts[free][::-1]] = k[free][::-1]  # the oldest is written last
        taker[hosts[taker[taker != NONE]]] = NONE  # a proposal that gains a part is no part itself
        parts = (taker != NONE).nonzero()[0]
        k = taker[parts]
        return rows[k], hosts[k], parts


def _cars(tracks: TrackTable, rows: Int) -> Bool:
    """(k,) which rows are."""
    cars: Bool = tracks.last_class[rows] == ObjectClass.CAR.value
    return cars


def _may_be_car(tracks: TrackTable, rows: Int) -> Bool:
    """(k,) which rows are cars, or background no longer than a car."""
    short = widths(tracks.envelope.take(rows, axis=0).T).max(axis=0, initial=0.0) < MAX_CAR_M
    may: Bool = _cars(tracks, rows) | (short & (tracks.last_class[rows] == ObjectClass.BACKGROUND.value))
    return may


def _person_like(observations: Observations, parts: Int) -> Bool:
    """(k,) which parts are as slim and as tall as a person."""
    extent = widths(observations.kdop.take(parts, axis=1)).max(axis=0, initial=0.0)
    return PART_PERSON.fits(extent, observations.bottom[parts], observations.top[parts])


def _may_take(tracks: TrackTable, rows: Int, owner: Int) -> Bool:
    """(k,) whether cars and background may take what the owners (NONE: no track) are matched with."""
    person, older, car = IS_PERSON[tracks.last_class[owner]], owner < rows, _cars(tracks, owner)
    senior = np.where(_cars(tracks, rows), car & older, car | older)
    free: Bool = (owner == NONE) | ~(person | senior)
    return free
