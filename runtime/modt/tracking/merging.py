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
from modt.geometry.kdop import WAYS, covered, lengths, touching
from modt.odometry.deskew import Placing
from modt.tracking.fragments import SETTLED
from modt.tracking.regrouping import Found
from modt.tracking.track_table import Followed
from modt.tracking.unions import Unions, united_matches, united_proposals, united_sightings
from modt.types import NONE, Bool, Int

CAR = ObjectClass.CAR.value
WITHIN = 0.7
"""Part of a piece's outline that lies within all that was seen of the car."""
LONGER_M = 0.3
"""Made whole, a car is no longer than was ever seen of it, and so much."""


class KnownJoining:
    """Makes cars whole that are known as such."""

    def regroup(self, tracks: Followed, found: Found, placing: Placing) -> Found:
        """What was found, with one proposal in place of the parts of each car."""
        rows, hosts, parts = _pieces(tracks, found)
        if not len(parts):
            return found
        n, T_world_sensor = len(found.proposals), placing.T_world_sensor
        unions, row = Unions.of(n, hosts, parts), np.full(n, NONE)
        row[hosts] = rows
        yaw = tracks.box[row[unions.hosts], 6] - yaw_of(T_world_sensor)  # as it was seen last: a piece may lie across
        proposals = united_proposals(found.proposals, unions, yaw)
        sightings = united_sightings(found.sightings, unions, proposals, T_world_sensor)
        return Found(proposals, sightings, united_matches(found.matches, unions))


def _pieces(tracks: Followed, found: Found) -> tuple[Int, Int, Int]:
    """Rows of cars, the proposal of each, and a further piece of it; every piece once."""
    matches, outlines = found.matches, found.sightings.outline
    cars = (_settled_cars(tracks, matches.rows) & (tracks.hits[matches.rows] >= SETTLED)).nonzero()[0]
    cars = cars[matches.rows[cars].argsort()]  # the eldest first: tracks are in the order of their birth
    rows, hosts = matches.rows[cars], matches.proposals[cars]
    if not len(rows):
        return rows, hosts, hosts
    known = tracks.hull.take(rows, axis=0).T + WAYS.T @ matches.place.take(cars, axis=0).T
    k, parts = touching(known, outlines)
    other = (parts != hosts[k]).nonzero()[0]
    k, parts = k[other], parts[other]
    piece, whole = outlines.take(parts, axis=1), known.take(k, axis=1)
    both = np.maximum(piece, outlines.take(hosts[k], axis=1))
    owner = np.full(outlines.shape[1], NONE)
    owner[matches.proposals] = matches.rows
    fits = (covered(piece, whole) > WITHIN) & (lengths(both) < lengths(whole) + LONGER_M).all(axis=0)
    fits &= _free(tracks, rows[k], owner[parts])
    taker = np.full(len(owner), NONE)
    taker[parts[fits][::-1]] = k[fits][::-1]  # the eldest is written last
    taker[hosts[taker[taker != NONE]]] = NONE  # who takes something gives nothing away
    parts = (taker != NONE).nonzero()[0]
    k = taker[parts]
    return rows[k], hosts[k], parts


def _settled_cars(tracks: Followed, rows: Int) -> Bool:
    """(k,) which rows are."""
    cars: Bool = tracks.final[rows] & (tracks.kind[rows] == CAR)
    return cars


def _free(tracks: Followed, rows: Int, rival: Int) -> Bool:
    """(k,) whether cars may take what the rivals (NONE: nobody) have."""
    person = tracks.final[rival] & (tracks.kind[rival] > CAR)
    elder = _settled_cars(tracks, rival) & (rival < rows)
    free: Bool = (rival == NONE) | ~(person | elder)
    return free
