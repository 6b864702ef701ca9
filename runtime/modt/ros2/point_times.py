"""Motion of a turning head from the times of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modt.types import Float32

SAMPLES = 512
"""Number of points that the motion is estimated from."""
SPANS_S = (0.02, 0.5)
"""Shortest and longest sweep [s]; the unit of the times is the one that puts their span between."""
UNITS_S = (1.0, 1e-6, 1e-9)
MAX_RESIDUAL = 0.03
"""Share of a turn by which most points may deviate from the line of time over bearing."""


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn of the head: duration as in Frame.turn_s, and time of straight ahead by the clock of the points [s]."""

    turn_s: float
    ahead_s: float


def turn_of(points: Float32, times: NDArray[np.generic]) -> Turn | None:
    """The turn of a sweep whose seam lies behind the sensor; None for another seam, or times that fit no turn.

    Args:
        points: (N, 4) of the sweep; points at the origin are ignored.
        times: (N,) of the points, in seconds, microseconds or nanoseconds.
    """
    chosen = slice(None, None, max(1, len(points) // SAMPLES))
    x, y, _, _ = points[chosen].T.astype(np.float64)
    t = times[chosen].astype(np.float64)
    used = ((x != 0) | (y != 0)) & np.isfinite(t)
    if np.count_nonzero(used) < SAMPLES // 8:
        return None
    x, y, t = x[used], y[used], t[used]
    unit_s = next((unit for unit in UNITS_S if SPANS_S[0] <= np.ptp(t) * unit <= SPANS_S[1]), None)
    if unit_s is None:
        return None
    begin, bearing = t.min(), np.arctan2(y, x)
    t = (t - begin) * unit_s
    slope, ahead_s = np.polyfit(bearing, t, 1)
    turn_s = -2 * np.pi * slope
    off = np.quantile(np.abs(t - slope * bearing - ahead_s), 0.9)
    if not off <= MAX_RESIDUAL * abs(turn_s):
        return None
    return Turn(float(turn_s), float(begin * unit_s + ahead_s))
