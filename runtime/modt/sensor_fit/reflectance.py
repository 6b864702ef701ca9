"""The scale of a sensor's reflectance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.types import Float32

NONE, OTHER = "none", "other"
"""None recorded; a scale that models do not know."""


@dataclass(frozen=True, slots=True)
class Scale:
    """What a sensor reports in streets.

    Attributes:
        deciles: of its reflectances, the first to the ninth.
        max_difference: mean over the deciles.
        hundredths: whether all of them are, as no other sensor's; else others may have the same scale.
    """

    deciles: tuple[float, ...]
    max_difference: float
    hundredths: bool = False


SCALES = {
    "hdl-64e": Scale((0.0, 0.15, 0.20, 0.24, 0.28, 0.30, 0.32, 0.36, 0.41), 0.12, hundredths=True),
    "pandar64": Scale((0.004, 0.012, 0.020, 0.027, 0.035, 0.047, 0.063, 0.084, 0.117), 0.025),
}
"""Of KITTI's object frames, and of nine scans of PandaSet."""


def reflectance_scale(reflectance: Float32) -> tuple[str, str]:
    """Scale of (N,) reflectances, and what speaks for it."""
    recorded = reflectance[reflectance >= 0]
    if len(recorded) < 0.5 * len(reflectance) or not len(recorded) or np.ptp(recorded) == 0:
        return NONE, "none is recorded"
    deciles = np.quantile(recorded, np.arange(0.1, 0.95, 0.1))
    hundredths = np.mean(np.abs(recorded * 100 - np.rint(recorded * 100)) < 0.01) > 0.99
    of_scale = f"median {deciles[4]:.2f}, 90 % below {deciles[8]:.2f}"
    for name, scale in SCALES.items():
        near = np.abs(deciles - scale.deciles).mean() < scale.max_difference
        if near and (hundredths or not scale.hundredths):
            return name, f"{'hundredths, ' * scale.hundredths}{of_scale}: as of the {name}"
    return OTHER, f"{of_scale}: of no scale that models have learnt"
