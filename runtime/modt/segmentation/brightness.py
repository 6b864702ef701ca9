"""How brightly clusters send light back."""

from __future__ import annotations

import numpy as np

from modt.segmentation.groups import Groups
from modt.types import Float32, Float64

BRIGHT = 0.8
"""Number plates, lamps and signs return so much, and hardly anything else."""
DARK = 0.005
"""Returns too weak to be measured are reported as none, or nearly."""


def brightness(reflectance: Float32, groups: Groups) -> Float64 | None:
    """(G, 5) mean, standard deviation, greatest, share of bright and share of dark returns of each group.

    None where all returns are alike: then whoever recorded them left reflectance out.

    Args:
        reflectance: (K,) of the rows of the groups, in their order [0, 1].
        groups: to tell apart.
    """
    if not len(groups) or reflectance.min() == reflectance.max():
        return None
    mean = groups.mean(reflectance)
    spread = np.sqrt(np.maximum(groups.mean(reflectance * reflectance) - mean * mean, 0.0))
    bright, dark = (groups.mean(such.astype(np.float32)) for such in (reflectance > BRIGHT, reflectance < DARK))
    told: Float64 = np.stack([mean, spread, groups.most(reflectance), bright, dark], axis=1)
    return told
