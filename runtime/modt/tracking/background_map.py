"""The map of remembered background: the class of a place outlives the track that stood there."""

from __future__ import annotations

import numpy as np

from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import BackgroundMapTuning
from modt.types import Bool, Int

CAPACITY = 2048
"""Places of deleted tracks that are remembered."""


class BackgroundMap:
    """k-DOPs and tops of deleted background in the world.

    Args:
        kernels: passes over pairs.
        capacity: greatest number of places; with 0 the map recalls nothing.
        tuning: limits within which something counts as a place.
    """

    def __init__(
        self,
        kernels: GeometryKernels = NUMPY_GEOMETRY,
        capacity: int = CAPACITY,
        tuning: BackgroundMapTuning = BackgroundMapTuning(),
    ) -> None:
        self.capacity = capacity
        self._kernels = kernels
        self._tuning = tuning
        self.clear()

    def clear(self) -> None:
        """Forget all places."""
        self._kdop = np.zeros((8, 0))
        self._top = np.zeros(0)

    def add(self, tracks: TrackTable, rows: Int) -> None:
        """Remember the places of rows, background at rest; beyond the capacity the oldest places are dropped."""
        if not len(rows):
            return
        first = max(0, len(self._top) + len(rows) - self.capacity)
        self._kdop = np.concatenate([self._kdop, tracks.kdop.take(rows, axis=0).T], axis=1)[:, first:]
        self._top = np.concatenate([self._top, tracks.top[rows]])[first:]

    def recall(self, tracks: TrackTable, rows: Int, observations: Observations, which: Int) -> Bool:
        """(n,) whether each of the observations `which` lies at a remembered place, or on a settled track of `rows`.

        It lies there if the place covers enough of it, and it rises little above the place.
        """
        known = np.zeros(len(which), np.bool_)
        if not self.capacity or not len(which):
            return known
        place = np.concatenate([self._kdop, tracks.known_kdops(rows)], axis=1)
        top = np.concatenate([self._top, tracks.top[rows]])
        kdop = observations.kdop.take(which, axis=1)
        new, old = self._kernels.overlapping_pairs(kdop, place)
        within = self._kernels.coverage(kdop, place, new, old) >= self._tuning.min_coverage
        within &= observations.top[which[new]] < top[old] + self._tuning.max_rise_m
        known[new[within]] = True
        return known
