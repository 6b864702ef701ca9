"""Landmarks: stationary objects at their mean position, by which a sensor without odometry is located.

A landmark lies where it was seen on average, not where it was seen last: the error of one frame is not handed on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import LandmarkConfig
from modt.observations import StaticTracks
from modt.types import Bool, Float64


@dataclass(frozen=True, slots=True)
class Landmarks:
    """What the registration matches against; n rows.

    Attributes:
        kdop: (8, n) where it should be seen [m, world].
        established: (n,) a mean over several frames.
    """

    kdop: Float64
    established: Bool

    def __len__(self) -> int:
        return len(self.established)


class LandmarkMap:
    """Mean k-DOPs of stationary tracks, by track id; kept only while no poses are given.

    Args:
        config: when a mean is established and how fast it follows.
    """

    def __init__(self, config: LandmarkConfig) -> None:
        self.config = config
        self.clear()

    def clear(self) -> None:
        """Forget all landmarks."""
        self._id = np.zeros(0, np.int64)
        self._frames = np.zeros(0, np.int64)
        self._mean = np.zeros((0, 8))

    def update(self, tracks: StaticTracks) -> Landmarks:
        """Take in the last frame, and return the landmarks; once a frame without a pose."""
        frames, mean = np.zeros(len(tracks.id), np.int64), np.zeros((len(tracks.id), 8))
        known = np.isin(tracks.id, self._id, assume_unique=True)
        before = self._id.searchsorted(tracks.id[known])
        frames[known], mean[known] = self._frames[before], self._mean.take(before, axis=0)
        rows = tracks.observed.nonzero()[0]
        frames[rows] = np.where(tracks.stationary[rows], frames[rows] + 1, 0)
        gain = np.maximum(1.0 / np.maximum(frames[rows], 1), self.config.min_gain)[:, None]
        off = tracks.kdop.take(rows, axis=0) - mean.take(rows, axis=0)
        mean[rows] += np.where(np.abs(off) < self.config.max_jump_m, gain, 1.0) * off
        self._id, self._frames, self._mean = tracks.id, frames, mean
        candidates = tracks.candidate.nonzero()[0]
        established = (tracks.stationary & (frames >= self.config.min_frames))[candidates]
        kdop = tracks.predicted_kdop.take(candidates, axis=1)
        kdop[:, established] = mean[candidates[established]].T
        return Landmarks(kdop, established)
