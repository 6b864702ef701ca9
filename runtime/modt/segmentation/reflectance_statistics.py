"""How brightly clusters send light back."""

from __future__ import annotations

import numpy as np

from modt.types import N_REFLECTANCE, Float32, Float64, Int

BRIGHT = 0.8
"""Number plates, lamps and signs return so much, and hardly anything else."""
DARK = 0.005
"""Returns too weak to be measured are reported as none, or nearly."""
SAMPLE = 1000
"""Returns, about, that tell whether a sweep carries reflectance."""


def recorded(reflectance: Float32) -> bool:
    """Whether a sweep of reflectances (N,) carries any: where all are alike, whoever recorded it left them out."""
    some = reflectance[:: max(1, len(reflectance) // SAMPLE)]
    some = some[some >= 0.0]
    return len(some) > 0 and bool(some.min() != some.max())


def brightness(reflectance: Float32, offsets: Int) -> Float64:
    """(G, 5) mean, standard deviation, greatest, share of bright and share of dark returns of each group.

    Returns of which none was recorded have no say; a group of nothing else is NaN.

    Args:
        reflectance: (K,) of the groups' returns, one group after the other [0, 1], less than 0 where not recorded.
        offsets: (G + 1,) group i owns reflectance[offsets[i]:offsets[i + 1]], never nothing.
    """
    if reflectance.min(initial=0.0) < 0.0:
        return _brightness_of_recorded(reflectance, offsets)
    starts, count = offsets[:-1], np.diff(offsets)
    bright, dark = (such.astype(np.float32) for such in (reflectance > BRIGHT, reflectance < DARK))
    summed = (reflectance, reflectance * reflectance, bright, dark)
    mean, square, bright_share, dark_share = (np.add.reduceat(v, starts) / count for v in summed)
    spread = np.sqrt(np.maximum(square - mean * mean, 0.0))
    greatest = np.maximum.reduceat(reflectance, starts)
    told: Float64 = np.stack([mean, spread, greatest, bright_share, dark_share], axis=1)
    return told


def _brightness_of_recorded(reflectance: Float32, offsets: Int) -> Float64:
    """(G, 5) the same where some returns have none."""
    known = reflectance >= 0.0
    left = np.add.reduceat(known, offsets[:-1], dtype=np.int64)
    told = np.full((len(left), N_REFLECTANCE), np.nan)
    told[left > 0] = brightness(reflectance[known], np.append(0, np.cumsum(left[left > 0])))
    return told
