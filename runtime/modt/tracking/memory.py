"""Background that is remembered: what was learnt about a place outlives the track that learnt it.

The rule. A proposal that no track claims, and whose outline lies for the greater part within that of something
classified as background which stood there - a track alive (it was part of it before it split off) or one deleted
since - takes over that class. It keeps it until it leaves the place; then its class is asked for like any other's.

The bound. The last CAPACITY places are kept, the oldest making room.

The risk. A pedestrian who stood before a wall, as one segment with it, is background until about half a metre away
from where the two parted. Heights are compared too, so that what stands higher than the place did is asked for.
"""

from __future__ import annotations

import numpy as np

from modt.tracking.followed import Followed
from modt.tracking.sightings import Sightings
from modt.types import Bool, Float64, Int

CAPACITY = 2048
"""Places kept."""
COVER = 0.6
"""Part of a proposal's outline that must lie within that of the place."""
RISE_M = 0.5
"""How far a proposal may rise above what stood at its place."""
PAD_M = 0.15
"""Outlines jitter by this much."""


class NoMemory:
    """Nothing is remembered: every new proposal asks."""

    def keep(self, tracks: Followed) -> None:
        """Forget them."""

    def recall(self, alive: Followed, sightings: Sightings, which: Int) -> Bool:
        """(n,) of the sightings named, none."""
        return np.zeros(len(which), np.bool_)


class BackgroundMemory:
    """Outlines of background that stood still, in the world frame."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._low, self._high = np.full((capacity, 4), np.inf), np.full((capacity, 4), -np.inf)
        self._top = np.full(capacity, -np.inf)
        self._next = 0

    def keep(self, tracks: Followed) -> None:
        """Remember the places of tracks that end: background all of them, and at rest."""
        slots = (self._next + np.arange(len(tracks))) % len(self._top)
        self._low[slots], self._high[slots], self._top[slots] = tracks.low, tracks.high, tracks.top
        self._next = int(self._next + len(tracks)) % len(self._top)

    def recall(self, alive: Followed, sightings: Sightings, which: Int) -> Bool:
        """(n,) of the sightings named, which appear where background stood.

        Args:
            alive: tracks of background at rest.
            sightings: of this frame.
            which: (n,) those that no track claims.
        """
        low = np.concatenate([self._low, alive.low])
        high = np.concatenate([self._high, alive.high])
        top = np.concatenate([self._top, alive.top])
        within = _covered(sightings.low[which], sightings.high[which], low, high) >= COVER
        known: Bool = (within & (sightings.top[which][:, None] < top + RISE_M)).any(axis=1)
        return known


def _covered(low: Float64, high: Float64, low_places: Float64, high_places: Float64) -> Float64:
    """(n, k) part of each outline (n, 4) within each place (k, 4): the lesser of two squares that hold it."""
    shared = np.ones((2, len(low), len(low_places)))
    for axis in range(4):
        a, b = low[:, axis, None], high[:, axis, None]
        common = np.minimum(b, high_places[:, axis] + PAD_M) - np.maximum(a, low_places[:, axis] - PAD_M)
        shared[axis % 2] *= np.maximum(common, 0.0) / np.maximum(b - a, PAD_M)
    part: Float64 = np.minimum(shared[0], shared[1])
    return part
