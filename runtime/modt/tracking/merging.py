"""Parts of a car that were segmented apart, made one where the car is known as a whole.

A pole before a car, or the edge of a bush, cuts it in two, in every frame of a while; counted as two, neither looks
like a car. But its track has seen how large it is.

The rule. What lies within all that was seen of a settled car, beside the part that its track was given, is made one
with that part, unless a settled person or cyclist has it, or an elder settled car, or both together are larger than
the car ever was.

The risk. Somebody who steps close to a parked car, and whom no view has settled as a person yet, becomes a part of
it.
"""

from __future__ import annotations

import numpy as np

from modt.classes import ObjectClass
from modt.geometry import yaw_of
from modt.geometry.kdop import DIRECTIONS, coverage, overlapping_pairs, widths
from modt.odometry.deskew import Placement
from modt.tracking.fragments import SETTLED
from modt.tracking.regrouping import Found
from modt.tracking.track_table import TrackTable
from modt.tracking.unions import Unions, united_matches, united_proposals, united_sightings
from modt.types import NONE, Bool, Int

CAR = ObjectClass.CAR.value
WITHIN = 0.7
"""Part of a piece's outline that lies within all that was seen of the car."""
LONGER_M = 0.3
"""Made whole, a car is no longer than was ever seen of it, and so much."""


class KnownCarMerge:
    """Makes cars whole that are known as such."""

    def regroup(self, tracks: TrackTable, found: Found, placement: Placement) -> Found:
        """What was found, with one proposal in place of the parts of each car."""
        rows, hosts, parts = _pieces(tracks, found)
        if not len(parts):
            return found
        n, T_world_sensor = len(found.proposals), placement.T_world_sensor
        unions, row = Unions.of(n, hosts, parts), np.full(n, NONE)
        row[hosts] = rows
        yaw = tracks.box[row[unions.hosts], 6] - yaw_of(T_world_sensor)  # as it was seen last: a piece may lie across
        proposals = united_proposals(found.proposals, unions, yaw)
        observations = united_sightings(found.observations, unions, proposals, T_world_sensor)
        return Found(proposals, observations, united_matches(found.matches, unions))


def _pieces(tracks: TrackTable, found: Found) -> tuple[Int, Int, Int]:
    """Rows of cars, the proposal of each, and a further piece of it; every piece once."""
    matches, kdops = found.matches, found.observations.kdop
    cars = (_settled_cars(tracks, matches.rows) & (tracks.hits[matches.rows] >= SETTLED)).nonzero()[0]
    cars = cars[matches.rows[cars].argsort()]  # the eldest first: tracks are in the order of their birth
    rows, hosts = matches.rows[cars], matches.proposals[cars]
    if not len(rows):
        return rows, hosts, hosts
    known = tracks.envelope.take(rows, axis=0).T + DIRECTIONS.T @ matches.position.take(cars, axis=0).T
    k, parts = overlapping_pairs(known, kdops)
    other = (parts != hosts[k]).nonzero()[0]
    k, parts = k[other], parts[other]
    piece, whole = kdops.take(parts, axis=1), known.take(k, axis=1)
    both = np.maximum(piece, kdops.take(hosts[k], axis=1))
    owner = np.full(kdops.shape[1], NONE)
    owner[matches.proposals] = matches.rows
    fits = (coverage(piece, whole) > WITHIN) & (widths(both) < widths(whole) + LONGER_M).all(axis=0)
    fits &= _free(tracks, rows[k], owner[parts])
    taker = np.full(len(owner), NONE)
    taker[parts[fits][::-1]] = k[fits][::-1]  # the eldest is written last
    taker[hosts[taker[taker != NONE]]] = NONE  # who takes something gives nothing away
    parts = (taker != NONE).nonzero()[0]
    k = taker[parts]
    return rows[k], hosts[k], parts


def _settled_cars(tracks: TrackTable, rows: Int) -> Bool:
    """(k,) which rows are."""
    cars: Bool = tracks.final[rows] & (tracks.last_class[rows] == CAR)
    return cars


def _free(tracks: TrackTable, rows: Int, rival: Int) -> Bool:
    """(k,) whether cars may take what the rivals (NONE: nobody) have."""
    person = tracks.final[rival] & (tracks.last_class[rival] > CAR)
    elder = _settled_cars(tracks, rival) & (rival < rows)
    free: Bool = (rival == NONE) | ~(person | elder)
    return free
