"""Statistics of the reflectance of clusters."""

from __future__ import annotations

import numpy as np

from modt.types import Float32, Float64, Int

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


def reflectance_sums(points: Float32, index: Int, offsets: Int) -> tuple[Float64, Float32]:
    """(5, G) number, sum, sum of squares, bright and dark ones of the measured values of each group, (G,) greatest.

    Group i has the (N, 4) points index[offsets[i]:offsets[i + 1]].
    """
    reflectance = points[index, 3]
    starts, measured = offsets[:-1], reflectance >= 0.0
    greatest: Float32 = np.maximum.reduceat(np.where(measured, reflectance, np.float32(-np.inf)), starts)
    own = np.where(measured, reflectance, np.float32(0.0))
    number, bright, dark = (
        np.add.reduceat(mask.astype(np.float32), starts) for mask in (measured, own > BRIGHT, measured & (own < DARK))
    )
    total, squares = (np.add.reduceat(v, starts, dtype=np.float64) for v in (own, own * own))
    return np.stack([number, total, squares, bright, dark]), greatest


def reflectance_statistics(sums: Float64, greatest: Float32) -> Float64:
    """(G, 5) mean, standard deviation, maximum, share of bright and share of dark returns of each group.

    Returns without a measurement are ignored; a group without any is NaN. Given are the reflectance_sums.
    """
    count = np.where(sums[0] > 0, sums[0], np.nan)
    mean, square, bright, dark = sums[1:] / count
    deviation = np.sqrt(np.maximum(square - mean * mean, 0.0))
    maximum = np.where(sums[0] > 0, greatest, np.nan)
    return np.stack([mean, deviation, maximum, bright, dark], axis=1)
