"""How brightly clusters send light back."""

from __future__ import annotations

import numpy as np

from modt.types import Float32, Float64, Int

BRIGHT = 0.8
"""Number plates, lamps and signs return so much, and hardly anything else."""
DARK = 0.005
"""Returns too weak to be measured are reported as none, or nearly."""


def brightness(reflectance: Float32, offsets: Int) -> Float64 | None:
    """(G, 5) mean, standard deviation, greatest, share of bright and share of dark returns of each group.

    None where all returns are alike: then whoever recorded them left reflectance out.

    Args:
        reflectance: (K,) of the groups' returns, one group after the other [0, 1].
        offsets: (G + 1,) group i owns reflectance[offsets[i]:offsets[i + 1]], never nothing.
    """
    if len(offsets) < 2 or reflectance.min() == reflectance.max():
        return None
    starts, count = offsets[:-1], np.diff(offsets)
    bright, dark = (such.astype(np.float32) for such in (reflectance > BRIGHT, reflectance < DARK))
    summed = (reflectance, reflectance * reflectance, bright, dark)
    mean, square, bright_share, dark_share = (np.add.reduceat(v, starts) / count for v in summed)
    spread = np.sqrt(np.maximum(square - mean * mean, 0.0))
    greatest = np.maximum.reduceat(reflectance, starts)
    return np.stack([mean, spread, greatest, bright_share, dark_share], axis=1)
