"""Objects taken out of what they touch, where they are expected.

Somebody who walks along a wall touches it now and then, and for a frame or two both are one proposal. Left alone, the
wall would have the walker, whose track would find nothing.

The rule. A track of an object, or of what walks whatever it is held for, that finds no proposal although it had one
of late, and is expected within one too large to be it, takes of that the points that lie where it is expected, if
there are about as many as it had and they reach as high as it did. What changed hands measures nothing: the track
goes on as it went.

The risk. What is taken confirms where it was expected: somebody who stepped behind the wall would go on in it. So
nothing is taken more than IN_A_ROW times in a row.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modt.geometry import transform, yaw_of
from modt.tracking.association import Matches
from modt.tracking.carving import carved
from modt.tracking.followed import Followed
from modt.tracking.kalman import SPEED, X, Y
from modt.tracking.kinship import PERSON_M, ROOM_M
from modt.tracking.outlines import WAYS, covered, lengths, touching
from modt.tracking.robust import carried
from modt.tracking.sightings import Sightings, sight
from modt.types import NONE, Bool, Float64, Int, ObjectClass, Proposals

SETTLED = 4
"""Views after which it is known where a track will be."""
FRESH = 3
"""Frames without a proposal after which it is not known any more."""
IN_A_ROW = 5
"""Frames for which a track may live on what it takes."""
SLIM_M, TALL_M, WAY_M, SIGMAS = 1.5, 0.5, 1.5, 2.5
"""What is no longer, and taller, has come so far from its home, and is faster than its speed is unsure by so many
deviations, walks. (On synthetic drives 28 of a hundred such were people; of what is slim and moves at all, 8.)"""
WITHIN = 0.6
"""Part of the expected outline that the larger proposal must cover."""
PAD_M = 0.2
"""Points may lie this far beyond the outline and the top expected."""
POINTS = 8
"""What is taken and what is left have so many points ..."""
KEPT = 0.4
"""... and what is taken has this part of those seen last ..."""
FALL_M = 0.4
"""... and does not end lower than expected by more."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a frame shows, and whose it is.

    Attributes:
        proposals: of the frame.
        sightings: the proposals in the world.
        matches: those that belong to tracks.
    """

    proposals: Proposals
    sightings: Sightings
    matches: Matches


class Parting(Protocol):
    """Takes objects out of what they touch."""

    def part(self, tracks: Followed, found: Found, T_world_sensor: Float64) -> Found:
        """What was found, with more proposals where there was something to take."""
        ...


class NoParting:
    """Takes proposals as they are."""

    def part(self, tracks: Followed, found: Found, T_world_sensor: Float64) -> Found:
        """What was found."""
        return found


class ExpectedParting:
    """Takes what lies where a track is expected."""

    def part(self, tracks: Followed, found: Found, T_world_sensor: Float64) -> Found:
        """What was found, with one more proposal for each track that takes its own out of a larger one."""
        tracks.takes[found.matches.rows] = 0
        rows = _seeking(tracks, found.matches)
        if not len(rows):
            return found
        rows, hosts = _hosts(tracks, found.sightings, rows)
        if not len(rows):
            return found
        scene = Scene(tracks, found, T_world_sensor)
        pieces: list[Int] = []
        takers = []
        for k, (row, host) in enumerate(zip(rows.tolist(), hosts.tolist(), strict=True)):
            piece = scene.piece(row, host)
            if piece is not None:
                pieces.append(piece)
                takers.append(k)
        if not pieces:
            return found
        rows, hosts = rows[takers], hosts[takers]
        tracks.takes[rows] += 1
        return scene.parted(rows, hosts, pieces)


class Scene:
    """A frame that objects are taken out of."""

    def __init__(self, tracks: Followed, found: Found, T_world_sensor: Float64) -> None:
        self.tracks, self.found, self.T_world_sensor = tracks, found, T_world_sensor
        proposals, matches = found.proposals, found.matches
        self.expected = carried(tracks)
        self.owner = np.full(len(proposals), NONE)
        self.owner[matches.proposals] = matches.rows
        self.free = np.ones(len(proposals.members), np.bool_)
        # Where a proposal stands at the stamp, seen when it was: a sensor that moves sees each from elsewhere.
        self.step = found.sightings.centroid - transform(T_world_sensor, proposals.centroid)[:, :2]

    def piece(self, row: int, host: int) -> Int | None:
        """(k,) members of the proposals that are a track's, of those of its host; None where it has no claim."""
        first, end = self.found.proposals.offsets[host : host + 2]
        x, y, z = self._world(first, end)
        x += self.step[host, 0]
        y += self.step[host, 1]
        own = self.free[first:end] & (z < self.tracks.top[row] + PAD_M) & self._within(x, y, row)
        own[own] = ~self._rivals(x[own], y[own], row, self.owner[host])
        n, left = np.count_nonzero(own), np.count_nonzero(self.free[first:end]) - np.count_nonzero(own)
        if n < max(POINTS, KEPT * self.tracks.points[row]) or left < POINTS:
            return None
        if z[own].max() < self.tracks.top[row] - FALL_M:
            return None
        piece: Int = first + np.flatnonzero(own)
        self.free[piece] = False
        return piece

    def _rivals(self, x: Float64, y: Float64, row: int, rival: int) -> Bool:
        """(k,) which places are rather those of the host's own track, if that is an object's."""
        tracks = self.tracks
        if rival == NONE or tracks.kind[rival] == ObjectClass.BACKGROUND.value:
            return np.zeros(len(x), np.bool_)
        own, other = (np.square(x - tracks.x[k, 0]) + np.square(y - tracks.x[k, 1]) for k in (row, rival))
        rivals: Bool = (other < own) & self._within(x, y, rival)
        return rivals

    def _world(self, first: int, end: int) -> Float64:
        """(3, k) members from first to end in the world."""
        R, t = self.T_world_sensor[:3, :3], self.T_world_sensor[:3, 3:]
        world: Float64 = R.astype(np.float32) @ self.found.proposals.coordinates[:, first:end] + t
        return world

    def _within(self, x: Float64, y: Float64, row: int) -> Bool:
        """(k,) which places lie where a track is expected."""
        reach = self.expected[:, row] + PAD_M
        within: Bool = (x <= reach[0]) & (x >= -reach[4]) & (y <= reach[2]) & (y >= -reach[6])
        near = np.flatnonzero(within)
        within[near] = (np.stack([x[near], y[near]], axis=1) @ WAYS <= reach).all(axis=1)
        return within

    def parted(self, rows: Int, hosts: Int, pieces: list[Int]) -> Found:
        """What is found once tracks have taken their pieces out of their hosts."""
        found, n = self.found, len(self.found.proposals)
        yaw = self.tracks.box[rows, 6] - yaw_of(self.T_world_sensor)
        proposals = carved(found.proposals, hosts, pieces, yaw)
        source, changed, new = np.append(np.arange(n), hosts), np.unique(hosts), np.arange(n, n + len(hosts))
        seen = np.append(changed, new)
        sightings = found.sightings.take(source)
        few = sight(proposals.take(seen), self.T_world_sensor)
        sightings.put(seen, few.moved(self.step[source[seen]]))
        # What was taken shows nothing new of the track, least of all what was taken too much.
        sightings.outline[:, new] = self.expected[:, rows]
        sightings.foot[new], sightings.top[new] = self.tracks.foot[rows], self.tracks.top[rows]
        owned = changed[self.owner[changed] != NONE]
        rows, of_rows = np.append(self.owner[owned], rows), np.append(owned, new)
        return Found(proposals, sightings, found.matches.instead(self.tracks, rows, of_rows))


def _seeking(tracks: Followed, matches: Matches) -> Int:
    """Rows of objects, and of what walks whatever it is held for, that found nothing and had something of late."""
    thing = tracks.kind != ObjectClass.BACKGROUND.value
    lost = (thing | ~tracks.still) & (tracks.hits >= SETTLED) & (tracks.missed < FRESH) & (tracks.takes < IN_A_ROW)
    lost[matches.rows] = False
    rows = np.flatnonzero(lost)
    seeking: Int = rows[thing[rows] | _walks(tracks, rows)]
    return seeking


def _walks(tracks: Followed, rows: Int) -> Bool:
    """(R,) what is as slim as a person, not flat, has come some way, and surely goes on."""
    slim = lengths(tracks.hull.take(rows, axis=0).T).max(axis=0) < SLIM_M
    tall = tracks.top[rows] - tracks.foot[rows] > TALL_M
    x, home = tracks.x.take(rows, axis=0), tracks.home.take(rows, axis=0)
    far = np.square(x[:, X] - home[:, 0]) + np.square(x[:, Y] - home[:, 1]) > WAY_M**2
    sure = x[:, SPEED] > SIGMAS * np.sqrt(tracks.P[rows, SPEED, SPEED])
    walks: Bool = slim & tall & far & sure
    return walks


def _hosts(tracks: Followed, sightings: Sightings, rows: Int) -> tuple[Int, Int]:
    """Those of the rows that are expected within a proposal, and which covers each best."""
    step = tracks.x.take(rows, axis=0)[:, :2] - tracks.shown.take(rows, axis=0)
    expected = (tracks.outline.take(rows, axis=0) + step @ WAYS).T
    i, j = touching(expected, sightings.outline)
    cover = covered(expected.take(i, axis=1), sightings.outline.take(j, axis=1))
    room = np.where(tracks.kind == ObjectClass.BACKGROUND.value, PERSON_M, ROOM_M[tracks.kind, 0])[rows[i]]
    large = lengths(sightings.outline.take(j, axis=1)).max(axis=0) > room
    least_first = cover.argsort(kind="stable")
    least_first = least_first[(large & (cover > WITHIN))[least_first]]
    host = np.full(len(rows), NONE)
    host[i[least_first]] = j[least_first]  # the last one written covers most
    some = host != NONE
    return rows[some], host[some]
