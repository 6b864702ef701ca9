"""Statistics of the reflectance of clusters."""

from __future__ import annotations

import numpy as np

from modt.types import N_REFLECTANCE, Float32, Float64, Int

BRIGHT = 0.8
"""Exceeded by number plates, lamps and signs only. Models are trained with this value and the next."""
DARK = 0.005
"""Below it a return is too weak to be measured."""
SAMPLE = 1000
"""Returns, about, by which a sweep is checked for reflectance."""


def has_reflectance(reflectance: Float32) -> bool:
    """Whether a sweep's (N,) reflectances differ; equal values mean that the recording has none."""
    sample = reflectance[:: max(1, len(reflectance) // SAMPLE)]
    sample = sample[sample >= 0.0]
    return len(sample) > 0 and bool(sample.min() != sample.max())


def reflectance_statistics(reflectance: Float32, offsets: Int) -> Float64:
    """(G, 5) mean, standard deviation, maximum, share of bright and share of dark returns of each group.

    Returns without a measurement are ignored; a group without any is NaN.

    Args:
        reflectance: (K,) returns sorted by group [0, 1], negative where not measured.
        offsets: (G + 1,) group i owns reflectance[offsets[i]:offsets[i + 1]]; none is empty.
    """
    if reflectance.min(initial=0.0) < 0.0:
        known = reflectance >= 0.0
        count = np.add.reduceat(known, offsets[:-1], dtype=np.int64)
        some = np.full((len(count), N_REFLECTANCE), np.nan)
        own = np.append(0, np.cumsum(count[count > 0]))
        some[count > 0] = reflectance_statistics(reflectance[known], own)
        return some
    starts, count = offsets[:-1], np.diff(offsets)
    bright, dark = (mask.astype(np.float32) for mask in (reflectance > BRIGHT, reflectance < DARK))
    summed = (reflectance, reflectance * reflectance, bright, dark)
    mean, square, bright_share, dark_share = (np.add.reduceat(v, starts) / count for v in summed)
    deviation = np.sqrt(np.maximum(square - mean * mean, 0.0))
    maximum = np.maximum.reduceat(reflectance, starts)
    statistics: Float64 = np.stack([mean, deviation, maximum, bright_share, dark_share], axis=1)
    return statistics
