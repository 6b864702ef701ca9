"""Filters of a row of numbers, which goes on mirrored beyond its ends; they give the values of scipy.ndimage."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from modt.types import Float64, Int

_DEVIATIONS = 4.0
"""Half width of a Gaussian, in standard deviations."""


def gaussian(values: Float64, deviation: float) -> Float64:
    """Mean weighted by a Gaussian of this standard deviation."""
    reach = int(_DEVIATIONS * deviation + 0.5)
    weights = np.exp(-0.5 / (deviation * deviation) * np.arange(-reach, reach + 1) ** 2)
    weights /= weights.sum()
    padded, n = np.pad(values, reach, "symmetric"), len(values)
    smooth: Float64 = values * weights[reach]
    for k in range(reach):
        smooth += (padded[k : k + n] + padded[2 * reach - k : 2 * reach - k + n]) * weights[k]
    return smooth


def running_mean(values: Float64, width: int) -> Float64:
    """Mean of windows of a width, of which an even one begins one value earlier."""
    padded = np.pad(values, (width // 2, (width - 1) // 2), "symmetric")
    first = padded[:width].cumsum()[-1:]
    mean: Float64 = np.concatenate([first, padded[width:] - padded[:-width]]).cumsum() / width
    return mean


def running_median(values: Int, width: int) -> Int:
    """Median of windows of an odd width."""
    windows = sliding_window_view(np.pad(values, width // 2, "symmetric"), width)
    return np.sort(windows, axis=1)[:, width // 2]
