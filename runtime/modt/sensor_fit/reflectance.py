"""The scale of a sensor's reflectance."""

from __future__ import annotations

import numpy as np

from modt.types import Float32

HDL_64E_DECILES = (0.0, 0.15, 0.20, 0.24, 0.28, 0.30, 0.32, 0.36, 0.41)
"""Of KITTI's object frames: the HDL-64E reports hundredths, most of them about 0.3."""
MAX_DIFFERENCE = 0.12  # mean over the deciles
NONE, HDL_64E, OTHER = "none", "hdl-64e", "other"
"""None recorded, one that models know, another."""


def reflectance_scale(reflectance: Float32) -> tuple[str, str]:
    """Scale of (N,) reflectances, and what speaks for it."""
    recorded = reflectance[reflectance >= 0]
    if len(recorded) < 0.5 * len(reflectance) or not len(recorded) or np.ptp(recorded) == 0:
        return NONE, "none is recorded"
    deciles = np.quantile(recorded, np.arange(0.1, 0.95, 0.1))
    difference = float(np.abs(deciles - HDL_64E_DECILES).mean())
    hundredths = np.abs(recorded * 100 - np.rint(recorded * 100)) < 0.01
    of_scale = f"median {deciles[4]:.2f}, 90 % below {deciles[8]:.2f}"
    if difference < MAX_DIFFERENCE and hundredths.mean() > 0.99:
        return HDL_64E, f"hundredths, {of_scale}: as an HDL-64E's"
    return OTHER, f"{of_scale}: not an HDL-64E's, and no model has learnt another"
