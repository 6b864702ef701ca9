"""Background that is remembered: what was learnt about a place outlives the track that learnt it.

The rule. A proposal that no track claims, and whose outline lies for the greater part within that of something
classified as background which stood there - a track alive (it was part of it before it split off) or one deleted
since - takes over that class. It keeps it until it leaves the place, or is classified all the same where fusion sees
reason to; if it leaves unclassified, its class is asked for like any other's.

The bound. The last CAPACITY places are kept, the oldest making room.

The risk. A pedestrian who stood before a wall, as one segment with it, is background until about half a metre away
from where the two parted. Heights are compared too, so that what stands higher than the place did is asked for.
"""

from __future__ import annotations

import numpy as np

from modt.geometry.kdop import DIRECTIONS, coverage, overlapping_pairs
from modt.observations import Observations
from modt.tracking.track_table import TrackTable
from modt.types import Bool, Int

CAPACITY = 2048
"""Places kept."""
COVER = 0.6
"""Part of a proposal's outline that must lie within that of the place."""
RISE_M = 0.5
"""How far a proposal may rise above what stood at its place."""


class NoBackgroundMap:
    """Nothing is remembered: every new proposal asks."""

    def keep(self, tracks: TrackTable, rows: Int) -> None:
        """Forget them."""

    def recall(self, tracks: TrackTable, rows: Int, observations: Observations, which: Int) -> Bool:
        """(n,) of the sightings named, none."""
        return np.zeros(len(which), np.bool_)


class BackgroundMap:
    """Outlines of background that stood still, in the world frame.

    Args:
        capacity: places kept.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._outline = np.full((8, capacity), -np.inf)
        self._top = np.full(capacity, -np.inf)
        self._next = self._filled = 0

    def __len__(self) -> int:
        return self._filled

    def keep(self, tracks: TrackTable, rows: Int) -> None:
        """Remember the places of tracks that end: background all of them, and at rest."""
        slots = (self._next + np.arange(len(rows))) % len(self._top)
        self._outline[:, slots], self._top[slots] = tracks.kdop.take(rows, axis=0).T, tracks.top[rows]
        self._next = int(self._next + len(rows)) % len(self._top)
        self._filled = min(self._filled + len(rows), len(self._top))

    def recall(self, tracks: TrackTable, rows: Int, observations: Observations, which: Int) -> Bool:
        """(n,) of the sightings named, which appear where background stood.

        Args:
            tracks: alive.
            rows: of those that are background at rest.
            observations: of this frame.
            which: (n,) those that no track claims.
        """
        n = self._filled
        alive = tracks.envelope.take(rows, axis=0) + tracks.x.take(rows, axis=0)[:, :2] @ DIRECTIONS
        position = np.concatenate([self._outline[:, :n], alive.T], axis=1)
        top = np.concatenate([self._top[:n], tracks.top[rows]])
        seen = observations.kdop.take(which, axis=1)
        i, j = overlapping_pairs(seen, position)
        within = coverage(seen.take(i, axis=1), position.take(j, axis=1)) >= COVER
        known = np.zeros(len(which), np.bool_)
        known[i[within & (observations.top[which[i]] < top[j] + RISE_M)]] = True
        return known
