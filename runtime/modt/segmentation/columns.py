"""The points of a sweep as columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.types import Bool, Float32, Int


@dataclass(frozen=True, slots=True)
class Columns:
    """Points of a sweep, a contiguous column a coordinate: what vectorised arithmetic is fastest on.

    Attributes:
        x, y, z: (N,) position [m, sensor frame].
        root: (N,) square root of the horizontal range [sqrt(m)]; the measure in which grids are spaced.
    """

    x: Float32
    y: Float32
    z: Float32
    root: Float32

    def __len__(self) -> int:
        return len(self.x)

    @classmethod
    def of(cls, points: Float32) -> Self:
        """Columns of (N, 3) or wider points."""
        x, y, z = np.ascontiguousarray(points[:, :3].T, np.float32)
        return cls(x, y, z, np.sqrt(np.sqrt(x * x + y * y)))

    def take(self, rows: Int | Bool) -> Self:
        """The rows given, by index or mask."""
        return type(self)(self.x[rows], self.y[rows], self.z[rows], self.root[rows])

    def xyz(self) -> Float32:
        """(N, 3) positions, a row a point [m]."""
        return np.stack([self.x, self.y, self.z], axis=1)
