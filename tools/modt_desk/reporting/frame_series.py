"""Columns over the frames of a run of any length, in bounded memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.types import Float64, Int

POINTS = 512
"""Points held at most; an even number."""


class FrameSeries:
    """Sums of columns over points of equally many frames; when all points are full, neighbours become one."""

    def __init__(self, columns: int, points: int = POINTS) -> None:
        self.frames_a_point, self.count = 1, 0
        self._sums = np.zeros((points, columns))

    def add(self, row: Sequence[float] | Float64) -> None:
        """Add the (columns,) values of one frame."""
        points = len(self._sums)
        if self.count == points * self.frames_a_point:
            self._sums[: points // 2] = self._sums[::2] + self._sums[1::2]
            self._sums[points // 2 :] = 0.0
            self.frames_a_point *= 2
        self._sums[self.count // self.frames_a_point] += row
        self.count += 1

    @property
    def frames(self) -> Int:
        """(points,) frames of each point; only the last may have fewer."""
        starts = np.arange(0, self.count, self.frames_a_point)
        each: Int = np.diff(starts, append=self.count)
        return each

    @property
    def means(self) -> Float64:
        """(points, columns) means over the frames of each point."""
        frames = self.frames
        mean: Float64 = self._sums[: len(frames)] / frames[:, None]
        return mean

    @property
    def total(self) -> Float64:
        """(columns,) sums over all frames."""
        total: Float64 = self._sums.sum(axis=0)
        return total
