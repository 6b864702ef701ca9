"""Peaks of a histogram, as scipy.signal.find_peaks finds them, which takes a second to import."""

from __future__ import annotations

import numpy as np

from modt.types import Float64, Int


def prominent_peaks(count: Float64) -> tuple[Int, Float64]:
    """(B,) bins of the local maxima, in the middle of a plateau, and (B,) by how much each stands out.

    The prominence of a peak is its height above the higher of the two valleys that part it from higher ground.
    """
    starts = np.flatnonzero(np.diff(count, prepend=np.nan) != 0)
    ends = np.append(starts[1:], len(count)) - 1
    height = count[starts]
    inner = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:]))
    valleys = [max(_valley(height[i::-1]), _valley(height[i:])) for i in inner.tolist()]
    return (starts[inner] + ends[inner]) // 2, height[inner] - np.array(valleys, np.float64)


def _valley(height: Float64) -> float:
    """Lowest value before the first that is higher than the first one."""
    higher = int(np.argmax(height > height[0]))
    return float(height[: higher or None].min())
