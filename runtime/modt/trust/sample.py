"""A few returns of a sweep, on which all checks of the trust work."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from modt.config import SensorConfig
from modt.types import Float32, Float64, Frame, Int

SAMPLE = 2003
"""Number of points looked at, a prime: no step between them is a multiple of the number of beams."""
REACH_SHARE = 0.6
"""Share of the range of the sensor within which returns are counted; load shedding cuts the range to it."""
NEAREST_M = 0.7
"""Greatest distance of what covers the sensor and is no return [m]."""


@lru_cache(maxsize=8)
def _rows(n: int) -> Int:
    """(k,) rows of n points, evenly spread."""
    return np.arange(n) if n <= SAMPLE else np.linspace(0, n - 1, SAMPLE).astype(np.int64)


@dataclass(frozen=True, slots=True)
class Sample:
    """Returns of a sweep.

    Attributes:
        time_s: time of the frame [s].
        xyz: (3, k) the sampled points [m, level sensor frame].
        range_m: (k,) their horizontal ranges.
        counted: (k,) whether each is a return that is neither a cover of the sensor nor out of reach.
        weight: number of points for which one stands.
        T_world_sensor: (4, 4) pose.
    """

    time_s: float
    xyz: Float32
    range_m: Float32
    counted: Int
    weight: float
    T_world_sensor: Float64


def sample(frame: Frame, T_world_sensor: Float64, sensor: SensorConfig) -> Sample:
    """The sample of a level frame."""
    n = len(frame.points)
    rows = _rows(n)
    xyz = np.ascontiguousarray(frame.points.take(rows, axis=0)[:, :3].T)
    range_m = np.hypot(xyz[0], xyz[1])
    counted = np.flatnonzero((range_m > NEAREST_M) & (range_m < REACH_SHARE * sensor.max_range_m))
    return Sample(frame.time_s, xyz, range_m, counted, n / max(len(rows), 1), T_world_sensor)
