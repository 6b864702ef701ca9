"""Objects taken out of what they touch, where they are expected.

Somebody who walks along a wall touches it now and then, and for a frame or two both are one proposal. Left alone, the
wall would have the walker, whose track would find nothing.

The rule. A track of an object, or of what walks whatever it is held for, that finds no proposal although it had one
a frame ago, and is expected within one that is longer, takes of that the points that lie where it is expected, if
there are about as many as it had and they reach as high as it did. What changed hands measures nothing: the track
goes on as it went.

The risk. What is taken confirms where it was expected: somebody who stepped behind the wall would go on in it. So
nothing is taken more than AT_MOST times since the track last had a proposal of its own.
"""

from __future__ import annotations

import numpy as np

from modt.classes import ObjectClass
from modt.geometry import transform, yaw_of
from modt.geometry.kdop import DIRECTIONS, coverage, overlapping_pairs, widths
from modt.observations import Observations, observe
from modt.odometry.deskew import Placement
from modt.tracking.association import Matches
from modt.tracking.carving import carved
from modt.tracking.fragments import SETTLED
from modt.tracking.kalman import SPEED, X, Y
from modt.tracking.kdop_association import predicted_kdops
from modt.tracking.regrouping import Found
from modt.tracking.track_table import TrackTable
from modt.types import NONE, Bool, Float64, Int

AT_MOST = 5
"""Times that a track takes before it must have something of its own again."""
SLIM_M, TALL_M, WAY_M, SIGMAS = 1.5, 0.5, 1.5, 2.5
"""What is no longer, and taller, has come so far from its home, and is faster than its speed is unsure by so many
deviations, walks. (On synthetic drives 28 of a hundred such were people; of what is slim and moves at all, 8.)"""
WITHIN = 0.6
"""Part of the expected outline that the larger proposal must cover."""
LONGER_M = 0.3
"""What is longer than what is expected by so much holds something else besides."""
PAD_M = 0.2
"""Points may lie this far beyond the outline and the top expected."""
POINTS = 8
"""What is taken and what is left have so many points ..."""
KEPT = 0.4
"""... and what is taken has this part of those seen last ..."""
FALL_M = 0.4
"""... and does not end lower than expected by more."""


class ExpectedSplit:
    """Takes what lies where a track is expected."""

    def regroup(self, tracks: TrackTable, found: Found, placement: Placement) -> Found:
        """What was found, with one more proposal for each track that takes its own out of a larger one."""
        tracks.splits[found.matches.rows] = 0
        rows = _seeking(tracks, found.matches)
        if not len(rows):
            return found
        rows, hosts = _hosts(tracks, found.observations, rows)
        if not len(rows):
            return found
        scene = _Scene(tracks, found, placement, rows, hosts)
        pieces = [scene.piece(k) for k in range(len(rows))]
        takers = np.array([k for k, piece in enumerate(pieces) if len(piece)], np.int64)
        if not len(takers):
            return found
        tracks.splits[rows[takers]] += 1
        return scene.parted(takers, [pieces[k] for k in takers])


class _Scene:
    """A frame in which some tracks seek their own within proposals that are too large to be them.

    Args:
        tracks: as predicted.
        found: of the frame.
        placing: by which it was put into the world.
        rows: (R,) of the tracks that seek.
        hosts: (R,) proposal that each is expected in.
    """

    def __init__(self, tracks: TrackTable, found: Found, placement: Placement, rows: Int, hosts: Int) -> None:
        self.tracks, self.found, self.placement, self.rows, self.hosts = tracks, found, placement, rows, hosts
        self.expected = predicted_kdops(tracks)
        self.step = placement.step(tracks.x.take(rows, axis=0)[:, :2])
        self.owner = np.full(len(found.proposals), NONE)
        self.owner[found.matches.proposals] = found.matches.rows
        self.free = np.ones(len(found.proposals.members), np.bool_)

    def piece(self, k: int) -> Int:
        """(n,) which members of the proposals the k-th of those who seek takes, none where it has no claim.

        What lies where another is expected as well, who seeks there too or has the host and is an object, is of him
        who is expected nearer.
        """
        row, host = self.rows[k], self.hosts[k]
        first, end = self.found.proposals.offsets[host : host + 2]
        R, t = self.placement.T_world_sensor[:3, :3], self.placement.T_world_sensor[:3, 3:]
        x, y, z = R.astype(np.float32) @ self.found.proposals.coordinates[:, first:end] + t
        x += self.step[k, 0]
        y += self.step[k, 1]
        free = self.free[first:end]
        own = free & (z < self.tracks.top[row] + PAD_M) & self._within(x, y, row)
        for rival in self._rivals(k):
            own &= ~(self._nearer(x, y, rival, row) & self._within(x, y, rival))
        n = np.count_nonzero(own)
        if n < max(POINTS, KEPT * self.tracks.points[row]) or np.count_nonzero(free) - n < POINTS:
            return np.zeros(0, np.int64)
        if z[own].max() < self.tracks.top[row] - FALL_M:
            return np.zeros(0, np.int64)
        piece: Int = first + own.nonzero()[0]
        self.free[piece] = False
        return piece

    def _rivals(self, k: int) -> list[int]:
        """Rows of the others who may claim a part of the host of the k-th."""
        owner = self.owner[self.hosts[k]]
        others = self.rows[(self.hosts == self.hosts[k]) & (self.rows != self.rows[k])].tolist()
        owns = owner != NONE and self.tracks.last_class[owner] != ObjectClass.BACKGROUND.value
        return [*others, int(owner)] if owns else others

    def _nearer(self, x: Float64, y: Float64, row: int, than: int) -> Bool:
        """(n,) which places are nearer to where one track is expected than to where another is."""
        one, other = (np.square(x - self.tracks.x[r, X]) + np.square(y - self.tracks.x[r, Y]) for r in (row, than))
        nearer: Bool = one < other
        return nearer

    def _within(self, x: Float64, y: Float64, row: int) -> Bool:
        """(n,) which places lie where a track is expected."""
        reach = self.expected[:, row] + PAD_M
        within: Bool = (x <= reach[0]) & (x >= -reach[4]) & (y <= reach[2]) & (y >= -reach[6])
        near = within.nonzero()[0]
        within[near] = (DIRECTIONS.T @ np.array((x[near], y[near])) <= reach[:, None]).all(axis=0)
        return within

    def parted(self, takers: Int, pieces: list[Int]) -> Found:
        """What is found once some of those who seek have taken their pieces."""
        tracks, found, T_world_sensor = self.tracks, self.found, self.placement.T_world_sensor
        rows, hosts, n = self.rows[takers], self.hosts[takers], len(found.proposals)
        proposals = carved(found.proposals, hosts, pieces, tracks.box[rows, 6] - yaw_of(T_world_sensor))
        source, cut, new = np.append(np.arange(n), hosts), np.unique(hosts), np.arange(n, n + len(hosts))
        # Where a host stands at the stamp, seen when it was: a sensor that moves sees each from elsewhere.
        moved = found.observations.centroid[cut] - transform(T_world_sensor, found.proposals.centroid[cut])[:, :2]
        observations, seen = found.observations.take(source), np.append(cut, new)
        few = observe(proposals.take(seen), T_world_sensor)
        observations.put(seen, few.moved(np.concatenate([moved, self.step[takers]])))
        # What was taken shows nothing new of the track, least of all what was taken too much.
        observations.kdop[:, new] = self.expected[:, rows]
        observations.bottom[new], observations.top[new] = tracks.bottom[rows], tracks.top[rows]
        owned = cut[self.owner[cut] != NONE]
        changed, of_changed = np.append(self.owner[owned], rows), np.append(owned, new)
        return Found(proposals, observations, found.matches.instead(tracks, changed, of_changed))


def _seeking(tracks: TrackTable, matches: Matches) -> Int:
    """Rows of objects, and of what walks whatever it is held for, that found nothing and did a frame ago."""
    lost = tracks.missed == 0
    lost[matches.rows] = False
    rows = lost.nonzero()[0]
    rows = rows[(tracks.hits[rows] >= SETTLED) & (tracks.splits[rows] < AT_MOST)]
    thing = tracks.last_class[rows] != ObjectClass.BACKGROUND.value
    seeking: Int = rows[thing | _walks(tracks, rows)]
    return seeking


def _walks(tracks: TrackTable, rows: Int) -> Bool:
    """(R,) what is as slim as a person, not flat, has come some way, and surely goes on."""
    x, rest_position = tracks.x.take(rows, axis=0), tracks.rest_position.take(rows, axis=0)
    walks: Bool = x[:, SPEED] > SIGMAS * np.sqrt(tracks.P[rows, SPEED, SPEED])
    if walks.any():  # seldom
        walks &= widths(tracks.envelope.take(rows, axis=0).T).max(axis=0) < SLIM_M
        walks &= tracks.top[rows] - tracks.bottom[rows] > TALL_M
        walks &= np.square(x[:, X] - rest_position[:, 0]) + np.square(x[:, Y] - rest_position[:, 1]) > WAY_M**2
    return walks


def _hosts(tracks: TrackTable, observations: Observations, rows: Int) -> tuple[Int, Int]:
    """Those of the rows that are expected within a proposal, and which covers each best."""
    expected = predicted_kdops(tracks, rows)
    i, j = overlapping_pairs(expected, observations.kdop)
    if not len(i):
        return rows[i], j
    kdop, expected = observations.kdop.take(j, axis=1), expected.take(i, axis=1)
    cover = coverage(expected, kdop)
    large = widths(kdop).max(axis=0) > widths(expected).max(axis=0) + LONGER_M
    least_first = cover.argsort(kind="stable")
    least_first = least_first[(large & (cover > WITHIN))[least_first]]
    host = np.full(len(rows), NONE)
    host[i[least_first]] = j[least_first]  # the last one written covers most
    some = host != NONE
    return rows[some], host[some]
