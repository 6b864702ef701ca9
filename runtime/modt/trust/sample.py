"""A few returns of a sweep, on which all checks of the trust work."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from modt.config import SensorConfig
from modt.types import Float32, Float64, Frame, Int

SAMPLE = 2003
"""Number of points looked at, a prime: no step between them is a multiple of the number of beams."""
REACH_SHARE = 0.6
"""Share of the range of the sensor within which returns are counted; load shedding cuts the range to it."""
OBSTACLE_M = (0.35, 1.8)
"""Heights above the ground between which a point belongs to an obstacle, not to ground or ceiling [m]."""
NEAREST_M = 0.7
"""Greatest distance of what covers the sensor and is no return [m]."""


@lru_cache(maxsize=8)
def _rows(n: int) -> Int:
    """(k,) rows of n points, evenly spread."""
    return np.arange(n) if n <= SAMPLE else np.linspace(0, n - 1, SAMPLE).astype(np.int64)


@dataclass(frozen=True)
class Sample:
    """Some points of a sweep. What the checks need of them is computed once, when it is asked for.

    Attributes:
        time_s: time of the frame [s].
        points: (k, 3) or wider points [m, level sensor frame].
        reach_m: range within which they count.
        weight: number of points for which one stands.
        T_world_sensor: (4, 4) pose.
    """

    time_s: float
    points: Float32
    reach_m: float
    weight: float
    T_world_sensor: Float64

    @cached_property
    def xyz(self) -> Float32:
        """(3, k) coordinates [m]."""
        return np.ascontiguousarray(self.points[:, :3].T)

    @cached_property
    def range_m(self) -> Float32:
        """(k,) horizontal ranges."""
        x, y, _ = self.xyz
        return np.asarray(np.sqrt(x * x + y * y))

    @cached_property
    def counted(self) -> Int:
        """(c,) rows of the returns that neither cover the sensor nor are out of reach."""
        return np.flatnonzero((self.range_m > NEAREST_M) & (self.range_m < self.reach_m))

    def obstacles(self, plane: Float64) -> Float32:
        """(3, m) counted points that stand above the ground (3,) as it was when this was first asked for."""
        known: Float32 | None = vars(self).get("_obstacles")
        if known is None:
            x, y, z = found = self.xyz.take(self.counted, axis=1)
            a, b, c = plane.astype(np.float32)
            height_m = z - (a + b * x + c * y)
            known = found.compress((height_m > OBSTACLE_M[0]) & (height_m < OBSTACLE_M[1]), axis=1)
            vars(self)["_obstacles"] = known
        return known


def sample(frame: Frame, T_world_sensor: Float64, sensor: SensorConfig) -> Sample:
    """The sample of a level frame."""
    n = len(frame.points)
    rows = _rows(n)
    points = frame.points.take(rows, axis=0)
    return Sample(frame.time_s, points, REACH_SHARE * sensor.max_range_m, n / max(len(rows), 1), T_world_sensor)
