"""Objects split off what they touch, where their tracks expect them.

A person who walks along a wall touches it now and then, and for a frame or two both are one proposal. The track of an
object that was matched a frame ago and is not now, and is expected within a longer proposal, takes the points of that
proposal that lie where it is expected, if there are about as many as it had and they reach as high as it did. The
split measures nothing: the track goes on as predicted.
"""

from __future__ import annotations

import numpy as np

from modt.classes import ObjectClass
from modt.geometry import yaw_of
from modt.geometry.kdop import DIRECTIONS, coverage, widths
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.placement import Placement
from modt.tracking.association import Matches
from modt.tracking.regrouping import Associated, Grouping, runs_of
from modt.tracking.track_table import ESTABLISHED_HITS, TrackTable
from modt.types import NONE, Bool, Float64, Int

MIN_COVERAGE, LONGER_M = 0.6, 0.3
"""A proposal holds something else beside a track if it covers so much of the expected k-DOP and is so much longer."""
PAD_M = 0.2
"""Margin around the expected k-DOP, and above the expected top, within which points are taken."""
MIN_POINTS, MIN_SHARE = 8, 0.4
"""Least number of points that are split off and that remain; least share of the points last seen."""
MAX_DROP_M = 0.4
"""Greatest distance of the top of a part below the expected top."""


class ExpectedSplitting:
    """Splits objects off larger proposals.

    Args:
        kernels: passes over points and pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels

    def regroup(self, tracks: TrackTable, frame: Associated, placement: Placement) -> Associated:
        """The frame with one more proposal for each track that is split off a larger one."""
        rows, hosts = self._hosts(tracks, frame.observations, self._unmatched(tracks, frame.matches))
        if not len(rows):
            return frame
        position = placement.deskew(tracks.x.take(rows, axis=0)[:, :2])
        expected = tracks.predicted_kdops(rows) + PAD_M
        free = np.ones(len(frame.proposals.members), np.bool_)
        pieces = [
            self._piece(tracks, frame, placement, row, host, step, kdop, free)
            for row, host, step, kdop in zip(rows.tolist(), hosts.tolist(), position, expected.T, strict=True)
        ]
        takers = np.array([k for k, piece in enumerate(pieces) if len(piece)], np.int64)
        if not len(takers):
            return frame
        return self._split(tracks, frame, placement, rows[takers], hosts[takers], [pieces[k] for k in takers])

    def _unmatched(self, tracks: TrackTable, matches: Matches) -> Int:
        """Rows of objects that were matched a frame ago and are not now."""
        lost = tracks.missed == 0
        lost[matches.rows] = False
        lost &= (tracks.hits >= ESTABLISHED_HITS) & (tracks.last_class != ObjectClass.BACKGROUND.value)
        rows: Int = lost.nonzero()[0]
        return rows

    def _hosts(self, tracks: TrackTable, observations: Observations, rows: Int) -> tuple[Int, Int]:
        """Those of the rows that are expected within a longer proposal, and the one that covers each best."""
        if not len(rows):
            return rows, rows
        expected = tracks.predicted_kdops(rows)
        i, j = self._kernels.overlapping_pairs(expected, observations.kdop)
        kdop, expected = observations.kdop.take(j, axis=1), expected.take(i, axis=1)
        covered = coverage(expected, kdop)
        longer = widths(kdop).max(axis=0) > widths(expected).max(axis=0) + LONGER_M
        order = covered.argsort(kind="stable")
        order = order[(longer & (covered > MIN_COVERAGE))[order]]
        host = np.full(len(rows), NONE)
        host[i[order]] = j[order]  # the last written covers most
        found = host != NONE
        return rows[found], host[found]

    def _piece(
        self,
        tracks: TrackTable,
        frame: Associated,
        placement: Placement,
        row: int,
        host: int,
        step: Float64,
        kdop: Float64,
        free: Bool,
    ) -> Int:
        """(n,) members of the host that the track takes, none where it may take none; they are free no more."""
        first, end = frame.proposals.offsets[host : host + 2]
        R, t = placement.T_world_sensor[:3, :3], placement.T_world_sensor[:3, 3:]
        x, y, z = R.astype(np.float32) @ frame.proposals.coordinates[:, first:end] + t
        x += step[0]
        y += step[1]
        available = free[first:end]
        own = available & (z < tracks.top[row] + PAD_M) & _within(x, y, kdop)
        n = np.count_nonzero(own)
        least = max(MIN_POINTS, MIN_SHARE * tracks.points[row])
        if n < least or np.count_nonzero(available) - n < MIN_POINTS:
            return np.zeros(0, np.int64)
        if z[own].max() < tracks.top[row] - MAX_DROP_M:
            return np.zeros(0, np.int64)
        piece: Int = first + own.nonzero()[0]
        free[piece] = False
        return piece

    def _split(
        self, tracks: TrackTable, frame: Associated, placement: Placement, rows: Int, hosts: Int, pieces: list[Int]
    ) -> Associated:
        """The frame with the pieces (n,) of the hosts as further proposals, each matched with its row."""
        old, n = frame.proposals, len(frame.proposals)
        changed_hosts, new = np.unique(hosts), np.arange(n, n + len(hosts))
        kept = np.ones(len(old.members), np.bool_)
        kept[np.concatenate(pieces)] = False
        runs, end = [], 0
        for begin, stop in old.offsets[np.array((changed_hosts, changed_hosts + 1))].T.tolist():
            runs += [np.array(((end,), (begin,))), runs_of(begin + kept[begin:stop].nonzero()[0])]
            end = stop
        runs += [np.array(((end,), (len(kept),))), *map(runs_of, pieces)]
        size = np.array([len(piece) for piece in pieces])
        count = np.append(old.count, size)
        np.subtract.at(count, hosts, size)
        yaw = tracks.box[rows, 6] - yaw_of(placement.T_world_sensor)
        grouping = Grouping(
            np.concatenate(runs, axis=1),
            count,
            np.append(np.arange(n), hosts),
            np.append(changed_hosts, new),
            np.append(old.box[changed_hosts, 6], yaw),
        )
        proposals, observations = grouping.apply(frame, placement, self._kernels)
        if proposals.reflectance is not None:
            proposals.reflectance[new] = np.nan
        # A piece shows nothing new of its track, least of all where too much was taken.
        observations.kdop[:, new] = tracks.predicted_kdops(rows)
        observations.bottom[new], observations.top[new] = tracks.bottom[rows], tracks.top[rows]
        owner = np.full(n, NONE)
        owner[frame.matches.proposals] = frame.matches.rows
        owned = changed_hosts[owner[changed_hosts] != NONE]
        changed, of_changed = np.append(owner[owned], rows), np.append(owned, new)
        return Associated(proposals, observations, frame.matches.reassigned(tracks, changed, of_changed))


def _within(x: Float64, y: Float64, kdop: Float64) -> Bool:
    """(n,) which positions lie within a k-DOP (8,)."""
    within: Bool = (x <= kdop[0]) & (x >= -kdop[4]) & (y <= kdop[2]) & (y >= -kdop[6])
    near = within.nonzero()[0]
    within[near] = (DIRECTIONS.T @ np.array((x[near], y[near])) <= kdop[:, None]).all(axis=0)
    return within
