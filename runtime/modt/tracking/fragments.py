"""Parts of one object that were segmented apart, and the one track that goes on with it.

A pole before a car, or the edge of a bush, cuts it in two; each part has a track, and which of them is the larger
changes from frame to frame. Two tracks of one class whose boxes fit together into the room of a single such object,
one of them within what was once seen of the other or around it, are not two objects: the elder goes with the larger
part, and takes the whole when only one is seen. A part that may be a person, and has a settled track, stays with it.
"""

from __future__ import annotations

import numpy as np

from modt.classes import ObjectClass
from modt.geometry.kdop import WAYS, covered, girth, lengths, touching
from modt.observations import Sightings
from modt.tracking.association import Matches
from modt.tracking.kalman import HEADING, SPEED
from modt.tracking.track_table import Followed
from modt.types import NONE, Bool, Float64, Int

ROOM_M = np.array([[6.0, 2.7], [6.0, 2.7], [1.1, 1.1], [2.2, 1.1]])
"""Greatest length and width of one object of each class; what counts as background may be a car not known as one."""
PERSON_M = float(ROOM_M[ObjectClass.PEDESTRIAN, 0])
"""What is longer is no person."""
BULKY = np.array([True, True, False, False])
"""Classes that are easily taken for one another: background and cars."""
APART_MPS, SIGMAS = 1.5, 2.0
"""Parts of one object do not differ so much in velocity, and by so many standard deviations of their speeds."""
WITHIN = 0.6
"""Part of one that must lie within what is known of the other."""
LESS = 1.2
"""An outline shrunk by this factor is a part."""
SETTLED = 4
"""Frames after which a velocity says something."""


def reunite(tracks: Followed, sightings: Sightings, matches: Matches) -> Matches:
    """The matches, with the larger part of an object given to its eldest track."""
    if not len(sightings):
        return matches
    proposal = np.full(len(tracks), NONE, np.int64)
    owner = np.full(len(sightings), NONE, np.int64)
    proposal[matches.rows], owner[matches.proposals] = matches.proposals, matches.rows
    elders = _incomplete(tracks, sightings, proposal)
    elders, parts = _parts(tracks, sightings, elders, proposal, owner)
    rows, proposals = swapped(elders, parts, proposal, owner)
    return matches.instead(tracks, rows, proposals) if len(rows) else matches


def swapped(elders: Int, parts: Int, proposal: Int, owner: Int) -> tuple[Int, Int]:
    """Who has another proposal once elders took parts and left their own to whoever had these; each changes once.

    Args:
        elders: (K,) rows that may take something, those that come first being served first.
        parts: (K,) what each may take.
        proposal: (M,) that each track has, NONE for none.
        owner: (P,) track that has each proposal, NONE for nobody.

    Returns:
        (R,) rows, ascending, and the proposal that each has now, NONE for none.
    """
    has: dict[int, int] = {}
    taken: set[int] = set()
    for elder, part in zip(elders.tolist(), parts.tolist(), strict=True):
        younger = int(owner[part])
        if part in taken or elder in has or younger in has:
            continue
        has[elder] = part
        if younger != NONE:
            has[younger] = int(proposal[elder])
        taken.add(part)
    rows = sorted(has)
    return np.array(rows, np.int64), np.array([has[row] for row in rows], np.int64)


def outgrown(kind: Int, outline: Float64) -> Int:
    """Which of the things, given their kinds (n,) and outlines (n, 8), are longer than any of their class: merged."""
    things: Int = (kind != ObjectClass.BACKGROUND.value).nonzero()[0]
    longer: Bool = lengths(outline.take(things, axis=0).T).max(axis=0, initial=0.0) > ROOM_M[kind[things], 0]
    return things[longer]


def _incomplete(tracks: Followed, sightings: Sightings, proposal: Int) -> Int:
    """Rows, eldest first, of what was seen more than once and is now not seen, or less of it than before."""
    now, known = girth(sightings.outline)[proposal], girth(tracks.hull.T.copy())
    less = (proposal == NONE) | (known > LESS * now)
    rows: Int = ((tracks.hits > 1) & less).nonzero()[0]  # tracks are in the order of their birth
    return rows


def _parts(tracks: Followed, sightings: Sightings, elders: Int, proposal: Int, owner: Int) -> tuple[Int, Int]:
    """Rows and proposals: an elder track, and a larger part of its object that it does not have."""
    if not len(elders):
        return elders, elders
    hull = (tracks.hull.take(elders, axis=0) + tracks.x.take(elders, axis=0)[:, :2] @ WAYS).T.copy()
    i, part = touching(hull, sightings.outline)
    elder, rival = elders[i], owner[part]
    size = np.where(proposal == NONE, 0, sightings.count[proposal])
    junior = (rival == NONE) | (tracks.id[rival] > tracks.id[elder])
    larger = (junior & (rival != elder) & (sightings.count[part] > size[elder])).nonzero()[0]
    stout = (sightings.box[part[larger], 3] > PERSON_M) & (tracks.box[elder[larger], 3] > PERSON_M)
    larger = larger[stout | _gives_way(tracks, elder[larger], rival[larger])]
    i, elder, part = i[larger], elder[larger], part[larger]
    moved = tracks.x.take(elder, axis=0)[:, :2] - tracks.shown.take(elder, axis=0)
    box = tracks.box.take(elder, axis=0)
    box[:, :2] += moved
    fits = _fits(box, sightings.box.take(part, axis=0), ROOM_M[tracks.kind[elder]])
    outline = sightings.outline.take(part, axis=1)
    within = covered(outline, hull.take(i, axis=1)) > WITHIN
    whole = covered((tracks.outline.take(elder, axis=0) + moved @ WAYS).T, outline) > WITHIN
    related = fits & (within | whole)
    elder, part = elder[related], part[related]
    free = _free(tracks, elder, owner[part])
    return elder[free], part[free]


def _free(tracks: Followed, elder: Int, rival: Int) -> Bool:
    """(k,) whether the elder may take the part that the rival (NONE: nobody) has: they may be one object."""
    kind, other = tracks.kind[elder], tracks.kind[rival]
    alike = ~tracks.final[rival] | (kind == other) | (BULKY[kind] & BULKY[other])
    (vx, vy), (wx, wy) = (_velocity(tracks.x.take(rows, axis=0)) for rows in (elder, rival))
    variance = tracks.P[:, SPEED, SPEED]
    doubt = SIGMAS * np.sqrt(variance[elder] + variance[rival])
    together = np.hypot(wx - vx, wy - vy) <= APART_MPS + doubt
    free: Bool = (rival == NONE) | alike & (together | (tracks.hits[rival] < SETTLED))
    return free


def _velocity(x: Float64) -> tuple[Float64, Float64]:
    """(k,) x and (k,) y of the velocities of states (k, 4) [m/s]."""
    return x[:, SPEED] * np.cos(x[:, HEADING]), x[:, SPEED] * np.sin(x[:, HEADING])


def _gives_way(tracks: Followed, elder: Int, rival: Int) -> Bool:
    """(k,) whether a part that may be a person goes to the elder: nobody settled has it, or the elder is a car."""
    car = tracks.final[elder] & (tracks.kind[elder] == ObjectClass.CAR.value)
    way: Bool = (rival == NONE) | (tracks.hits[rival] < SETTLED) | car
    return way


def _fits(a: Float64, b: Float64, room: Float64) -> Bool:
    """(k,) whether boxes a and b (k, 7) lie within one box of the room (k, 2), along the heading of the longer."""
    yaw = np.where(a[:, 3] > b[:, 3], a[:, 6], b[:, 6])
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = (b[:, :2] - a[:, :2]).T
    apart = np.array((x * c + y * s, y * c - x * s))
    half_a, half_b = (_half_widths(box, yaw) for box in (a, b))
    span = np.maximum(half_a, apart + half_b) - np.minimum(-half_a, apart - half_b)
    fits: Bool = (np.maximum(*span) < room[:, 0]) & (np.minimum(*span) < room[:, 1])
    return fits


def _half_widths(boxes: Float64, yaw: Float64) -> Float64:
    """(2, k) how far each box (k, 7) reaches from its middle along its heading yaw and across it [m]."""
    (length, width), turn = boxes[:, 3:5].T / 2, yaw - boxes[:, 6]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return np.array((length * c + width * s, length * s + width * c))
