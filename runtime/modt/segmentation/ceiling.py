"""The ceiling of a room: nothing of it becomes a proposal, and it joins none."""

from __future__ import annotations

import numpy as np

from modt.types import Float32, Int

ABOVE_M = 1.95
"""Above ground: returns from here on are those of which a ceiling has its share."""
LOWEST_M = 2.15
"""Least height of a ceiling above ground; a lower surface is the lintel of a door."""
BIN_M = 0.05
"""Width of a bin of the histogram of heights; two neighbouring bins hold a ceiling."""
MIN_RETURNS, MIN_SHARE = 50, 0.5
"""Returns above ABOVE_M in a room, and share of them that are on the ceiling."""
EDGE_SHARE, CLEARANCE_M = 0.05, 0.15
"""Share of its returns from which the bin below belongs to it too; distance below it up to which objects reach."""
SAMPLED = 8
"""One return of so many is looked at for a ceiling that begins above the greatest height used."""
GRAZED_M, GRAZED_CLEARANCE_M = (-0.1, 0.3), 0.2
"""Bounds of such a ceiling above the greatest height used; distance below that height up to which objects reach."""


def bins_up_to(max_height_m: float) -> int:
    """Bins of the histogram of heights up to the greatest height used [m]."""
    return max(0, int((max_height_m - ABOVE_M) / BIN_M)) + 2


def histogram(height: Float32, max_height_m: float) -> Int:
    """Returns in each bin of height above ABOVE_M, by (K,) heights of returns above ground [m]."""
    upper = height[height > np.float32(ABOVE_M)]
    bin_ = ((upper - np.float32(ABOVE_M)) / np.float32(BIN_M)).astype(np.int64)
    return np.bincount(bin_, minlength=bins_up_to(max_height_m))


def below_ceiling_m(count: Int) -> float | None:
    """Height [m] up to which objects reach under a ceiling, by the histogram of heights; None outdoors.

    Most of the returns above people's heads are at one height there; on walls, trees and houses they spread.
    """
    upper = int(count.sum())
    if upper < MIN_RETURNS:
        return None
    pair = count[:-1] + count[1:]
    pair[: round((LOWEST_M - ABOVE_M) / BIN_M)] = 0
    first = int(pair.argmax())
    if pair[first] < MIN_SHARE * upper:
        return None
    begins = first - 1 if first and count[first - 1] > EDGE_SHARE * pair[first] else first
    return ABOVE_M + BIN_M * begins - CLEARANCE_M


def below_grazed_m(z: Float32, sensor_height_m: float, max_height_m: float) -> float | None:
    """The same for a ceiling about the greatest height used, by (N,) sampled heights relative to the sensor [m]."""
    z = np.ascontiguousarray(z)
    upper = z.compress(z > np.float32(ABOVE_M - sensor_height_m)) + np.float32(sensor_height_m)
    on_ceiling = np.count_nonzero((upper > max_height_m + GRAZED_M[0]) & (upper < max_height_m + GRAZED_M[1]))
    if SAMPLED * len(upper) < MIN_RETURNS or on_ceiling < MIN_SHARE * len(upper):
        return None
    return max_height_m - GRAZED_CLEARANCE_M
