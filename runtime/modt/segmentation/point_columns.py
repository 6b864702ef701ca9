"""Points of a sweep as columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.types import Bool, Float32, Int


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
        """Columns of (N, 3) or wider points."""
        x, y, z = np.ascontiguousarray(points[:, :3].T, np.float32)
        return cls(x, y, z, np.sqrt(np.sqrt(x * x + y * y)))

    def take(self, rows: Int | Bool) -> Self:
        """Rows by index or mask."""
        return type(self)(self.x[rows], self.y[rows], self.z[rows], self.sqrt_range[rows])

    def xyz(self) -> Float32:
        """(N, 3) positions [m]."""
        return np.stack([self.x, self.y, self.z], axis=1)
