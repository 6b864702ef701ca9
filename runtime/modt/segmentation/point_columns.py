"""Points of a sweep as columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.types import Float32, Int

FAR_M = np.float32(1e6)
"""Farther than any return: cells of points nearer can be numbered."""


@dataclass(frozen=True, slots=True)
class PointColumns:
    """Points of a sweep, one contiguous column a coordinate: the fastest layout for vectorised arithmetic."""

    x: Float32  # (N,) [m, sensor frame]
    y: Float32
    z: Float32
    sqrt_range: Float32  # (N,) square root of the horizontal range [sqrt(m)], the unit of the grids

    def __len__(self) -> int:
        return len(self.x)

    @classmethod
    def from_array(cls, points: Float32) -> Self:
        """Columns of (N, 3) or wider points; one without a position within FAR_M is taken to the sensor."""
        columns = np.ascontiguousarray(points[:, :3].T, np.float32)
        if columns.size and not (columns.min() > -FAR_M and columns.max() < FAR_M):  # NaN is neither
            columns[:, ~(np.abs(columns) < FAR_M).all(axis=0)] = 0.0
        x, y, z = columns
        return cls(x, y, z, np.sqrt(np.sqrt(x * x + y * y)))

    def take(self, rows: Int) -> Self:
        """Rows by index."""
        return type(self)(self.x.take(rows), self.y.take(rows), self.z.take(rows), self.sqrt_range.take(rows))

    def xyz(self) -> Float32:
        """(N, 3) positions [m]."""
        return np.stack([self.x, self.y, self.z], axis=1)
