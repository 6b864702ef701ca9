"""Parts of one object that were segmented apart, and the one track that goes on with it.

A pole before a car, or the edge of a bush, cuts it in two; each part has a track, and which of them is the larger
changes from frame to frame. Two tracks of one class whose boxes fit together into the room of a single such object,
one of them within what was once seen of the other or around it, are not two objects: the elder goes with the larger
part, and takes the whole when only one is seen. A part that may be a person, and has a settled track, stays with it.
"""

from __future__ import annotations

import numpy as np

from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS, coverage, overlapping_pairs, width_sum, widths
from modt.observations import Observations
from modt.tracking.association import Matches
from modt.tracking.kalman import HEADING, SPEED
from modt.tracking.track_table import TrackTable
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


def reunite_fragments(tracks: TrackTable, observations: Observations, matches: Matches) -> Matches:
    """The matches, with the larger part of an object given to its eldest track."""
    if not len(observations):
        return matches
    proposal = np.full(len(tracks), NONE, np.int64)
    owner = np.full(len(observations), NONE, np.int64)
    proposal[matches.rows], owner[matches.proposals] = matches.proposals, matches.rows
    elders = _incomplete(tracks, observations, proposal)
    elders, parts = _parts(tracks, observations, elders, proposal, owner)
    rows, proposals = swap_proposals(elders, parts, proposal, owner)
    return matches.instead(tracks, rows, proposals) if len(rows) else matches


def swap_proposals(elders: Int, parts: Int, proposal: Int, owner: Int) -> tuple[Int, Int]:
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


def oversized(kind: Int, kdop: Float64) -> Int:
    """Which of the things, given their kinds (n,) and outlines (n, 8), are longer than any of their class: merged."""
    things: Int = (kind != ObjectClass.BACKGROUND.value).nonzero()[0]
    longer: Bool = widths(kdop.take(things, axis=0).T).max(axis=0, initial=0.0) > ROOM_M[kind[things], 0]
    return things[longer]


def _incomplete(tracks: TrackTable, observations: Observations, proposal: Int) -> Int:
    """Rows, eldest first, of what was seen more than once and is now not seen, or less of it than before."""
    now, known = width_sum(observations.kdop)[proposal], width_sum(tracks.envelope.T.copy())
    less = (proposal == NONE) | (known > LESS * now)
    rows: Int = ((tracks.hits > 1) & less).nonzero()[0]  # tracks are in the order of their birth
    return rows


def _parts(tracks: TrackTable, observations: Observations, elders: Int, proposal: Int, owner: Int) -> tuple[Int, Int]:
    """Rows and proposals: an elder track, and a larger part of its object that it does not have."""
    if not len(elders):
        return elders, elders
    envelope = (tracks.envelope.take(elders, axis=0) + tracks.x.take(elders, axis=0)[:, :2] @ DIRECTIONS).T.copy()
    i, part = overlapping_pairs(envelope, observations.kdop)
    elder, rival = elders[i], owner[part]
    size = np.where(proposal == NONE, 0, observations.count[proposal])
    junior = (rival == NONE) | (tracks.id[rival] > tracks.id[elder])
    larger = (junior & (rival != elder) & (observations.count[part] > size[elder])).nonzero()[0]
    stout = (observations.box[part[larger], 3] > PERSON_M) & (tracks.box[elder[larger], 3] > PERSON_M)
    larger = larger[stout | _gives_way(tracks, elder[larger], rival[larger])]
    i, elder, part = i[larger], elder[larger], part[larger]
    moved = tracks.x.take(elder, axis=0)[:, :2] - tracks.anchor.take(elder, axis=0)
    box = tracks.box.take(elder, axis=0)
    box[:, :2] += moved
    fits = _fits(box, observations.box.take(part, axis=0), ROOM_M[tracks.last_class[elder]])
    kdop = observations.kdop.take(part, axis=1)
    within = coverage(kdop, envelope.take(i, axis=1)) > WITHIN
    whole = coverage((tracks.kdop.take(elder, axis=0) + moved @ DIRECTIONS).T, kdop) > WITHIN
    related = fits & (within | whole)
    elder, part = elder[related], part[related]
    free = _free(tracks, elder, owner[part])
    return elder[free], part[free]


def _free(tracks: TrackTable, elder: Int, rival: Int) -> Bool:
    """(k,) whether the elder may take the part that the rival (NONE: nobody) has: they may be one object."""
    kind, other = tracks.last_class[elder], tracks.last_class[rival]
    alike = ~tracks.final[rival] | (kind == other) | (BULKY[kind] & BULKY[other])
    (vx, vy), (wx, wy) = (_velocity(tracks.x.take(rows, axis=0)) for rows in (elder, rival))
    variance = tracks.P[:, SPEED, SPEED]
    end_variance = SIGMAS * np.sqrt(variance[elder] + variance[rival])
    together = np.hypot(wx - vx, wy - vy) <= APART_MPS + end_variance
    free: Bool = (rival == NONE) | alike & (together | (tracks.hits[rival] < SETTLED))
    return free


def _velocity(x: Float64) -> tuple[Float64, Float64]:
    """(k,) x and (k,) y of the velocities of states (k, 4) [m/s]."""
    return x[:, SPEED] * np.cos(x[:, HEADING]), x[:, SPEED] * np.sin(x[:, HEADING])


def _gives_way(tracks: TrackTable, elder: Int, rival: Int) -> Bool:
    """(k,) whether a part that may be a person goes to the elder: nobody settled has it, or the elder is a car."""
    car = tracks.final[elder] & (tracks.last_class[elder] == ObjectClass.CAR.value)
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
