"""Parts of one object that were segmented apart, and the one track that goes on with it.

A pole before a car, or the edge of a bush, cuts it in two; each part has a track, and which of them is the larger
changes from frame to frame. Two tracks of one class whose boxes fit together into the room of a single such object,
one of them within what was once seen of the other or around it, are not two objects: the elder goes with the larger
part, and takes the whole when only one is seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.geometry import corners
from modt.tracking.association import Matches
from modt.tracking.followed import Followed
from modt.tracking.sightings import AXES, Sightings, covered, touching
from modt.types import NONE, Bool, Float64, Int, ObjectClass

ROOM_M = np.array([[6.0, 2.7], [6.0, 2.7], [1.1, 1.1], [2.2, 1.1]])
"""Greatest length and width of one object of each class; what counts as background may be a car not known as one."""
APART_MPS = 1.5
"""Parts of one object do not differ so much in velocity."""
WITHIN = 0.6
"""Part of one that must lie within what is known of the other."""
LESS = 1.2
"""An outline shrunk by this factor is a part."""
SETTLED = 4
"""Frames after which a velocity says something."""
UNMEASURED_M2 = 100.0
"""Variance of a place that another part's outline says nothing about."""


def reunite(tracks: Followed, sightings: Sightings, matches: Matches) -> Matches:
    """The matches, with the larger part of an object given to its eldest track."""
    if not len(sightings):
        return matches
    proposal = np.full(len(tracks), NONE, np.int64)
    owner = np.full(len(sightings), NONE, np.int64)
    proposal[matches.rows], owner[matches.proposals] = matches.proposals, matches.rows
    elders = _incomplete(tracks, sightings, proposal)
    swapped = np.zeros(len(tracks), np.bool_)
    taken = np.zeros(len(sightings), np.bool_)
    for elder, part in zip(*_parts(tracks, sightings, elders, proposal, owner), strict=True):
        younger, left = owner[part], proposal[elder]
        if taken[part] or swapped[elder] or (younger != NONE and swapped[younger]):
            continue
        proposal[elder], owner[part], taken[part], swapped[elder] = part, elder, True, True
        if younger != NONE:
            proposal[younger], swapped[younger] = left, True
        if left != NONE:
            owner[left], taken[left] = younger, True
    if not swapped.any():
        return matches
    return _with(tracks, matches, proposal, swapped)


def _incomplete(tracks: Followed, sightings: Sightings, proposal: Int) -> Int:
    """Rows, eldest first, that are classified and now without a proposal, or with less than was seen before."""
    rows = np.flatnonzero(tracks.fixed | (tracks.views > 0))
    now = sightings.high[proposal[rows]] - sightings.low[proposal[rows]]
    known = tracks.hull_high[rows] - tracks.hull_low[rows]
    less = (proposal[rows] == NONE) | (known.sum(axis=1) > LESS * now.sum(axis=1))
    eldest_first: Int = rows[less][np.argsort(tracks.id[rows[less]])]
    return eldest_first


def _parts(tracks: Followed, sightings: Sightings, elders: Int, proposal: Int, owner: Int) -> tuple[Int, Int]:
    """Rows and proposals: an elder track, and a larger part of its object that it does not have."""
    about = tracks.x[elders, :2] @ AXES
    moved = about - tracks.shown[elders] @ AXES
    low, high = tracks.low[elders] + moved, tracks.high[elders] + moved
    hull_low, hull_high = tracks.hull_low[elders] + about, tracks.hull_high[elders] + about
    if not len(elders):
        return elders, elders
    i, part = touching(hull_low, hull_high, sightings.low, sightings.high)
    elder, rival = elders[i], owner[part]
    class_ = tracks.posterior.argmax(axis=1)
    bulky = class_ <= ObjectClass.CAR  # one is easily taken for the other where little is seen of it
    size = np.where(proposal == NONE, 0, sightings.count[proposal])
    free = (rival == NONE) | ~tracks.fixed[rival] | (class_[rival] == class_[elder]) | bulky[rival] & bulky[elder]
    junior = (rival == NONE) | (tracks.id[rival] > tracks.id[elder])
    vx, vy = tracks.x[:, 3] * np.cos(tracks.x[:, 2]), tracks.x[:, 3] * np.sin(tracks.x[:, 2])
    apart = np.hypot(vx[rival] - vx[elder], vy[rival] - vy[elder]) > APART_MPS
    free &= (rival == NONE) | (tracks.hits[rival] < SETTLED) | ~apart
    larger = free & junior & (rival != elder) & (sightings.count[part] > size[elder])
    i, elder, part = i[larger], elder[larger], part[larger]
    box = tracks.box[elder]
    box[:, :2] += tracks.x[elder, :2] - tracks.shown[elder]
    fits = _fits(box, sightings.box[part], ROOM_M[class_[elder]])
    within = covered(sightings.low[part], sightings.high[part], hull_low[i], hull_high[i]) > WITHIN
    whole = covered(low[i], high[i], sightings.low[part], sightings.high[part]) > WITHIN
    related = fits & (within | whole)
    return elder[related], part[related]


def _fits(a: Float64, b: Float64, room: Float64) -> Bool:
    """(k,) whether boxes a and b (k, 7) lie within one box of the room (k, 2), along the heading of the longer."""
    yaw = np.where(a[:, 3] > b[:, 3], a[:, 6], b[:, 6])
    points = np.concatenate([corners(a), corners(b)], axis=1)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    along = np.ptp(points[..., 0] * c + points[..., 1] * s, axis=1)
    across = np.ptp(points[..., 1] * c - points[..., 0] * s, axis=1)
    long, short = np.maximum(along, across), np.minimum(along, across)
    fits: Bool = (long < room[:, 0]) & (short < room[:, 1])
    return fits


def _with(tracks: Followed, matches: Matches, proposal: Int, swapped: Bool) -> Matches:
    """The matches after the exchange: what changed hands measures nothing."""
    place = tracks.x[:, :2].copy()
    R = np.broadcast_to(UNMEASURED_M2 * np.eye(2), (len(tracks), 2, 2)).copy()
    kept = ~swapped[matches.rows]
    place[matches.rows[kept]], R[matches.rows[kept]] = matches.place[kept], matches.R[kept]
    rows = np.flatnonzero(proposal != NONE)
    return replace(matches, rows=rows, proposals=proposal[rows], place=place[rows], R=R[rows])
