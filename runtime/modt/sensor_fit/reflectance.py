"""Recognition of the scale of reflectances, which is named after a sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import SensorConfig
from modt.sensor_fit.beams import nearest_profile, tangents
from modt.types import Float32

NONE = "none"
"""Scale of a sweep without reflectance."""
OTHER = "other"
"""Scale that models do not know."""


@dataclass(frozen=True)
class Scale:
    """Reflectances that a sensor reports in streets.

    Attributes:
        deciles: first to ninth decile of its reflectances.
        max_difference: greatest mean difference from the deciles at which reflectances are on this scale.
        hundredths: whether all reflectances are hundredths, which tells this sensor from any other.
    """

    deciles: tuple[float, ...]
    max_difference: float
    hundredths: bool = False


SCALES = {
    "hdl-64e": Scale((0.0, 0.15, 0.20, 0.24, 0.28, 0.30, 0.32, 0.36, 0.41), 0.12, hundredths=True),
    "pandar64": Scale((0.004, 0.012, 0.020, 0.027, 0.035, 0.047, 0.063, 0.084, 0.117), 0.025),
}
"""Scales that models know, measured in KITTI's object frames and in nine scans of PandaSet."""


def recorded_in(reflectance: Float32) -> Float32:
    """Recorded values among (N,) reflectances; none where these are few or all alike."""
    recorded = reflectance[reflectance >= 0]
    few = len(recorded) < 0.5 * len(reflectance) or not len(recorded) or np.ptp(recorded) == 0
    return recorded[:0] if few else recorded


def reflectance_scale(reflectance: Float32) -> str:
    """Scale of (N,) reflectances: a name of SCALES, NONE or OTHER."""
    recorded = recorded_in(reflectance)
    if not len(recorded):
        return NONE
    deciles = np.quantile(recorded, np.arange(0.1, 0.95, 0.1))
    hundredths = np.mean(np.abs(recorded * 100 - np.rint(recorded * 100)) < 0.01) > 0.99
    for name, scale in SCALES.items():
        near = np.abs(deciles - scale.deciles).mean() < scale.max_difference
        if near and (hundredths or not scale.hundredths):
            return name
    return OTHER


def usable_scale(points: Float32, scale: str, sensor: SensorConfig) -> str:
    """The scale of (N, 4) points if a model may use it, else NONE.

    Sensors may share a scale, so one without hundredths is usable only with the beams of the sensor that it is named
    after.
    """
    known = SCALES.get(scale)
    usable = known and (known.hundredths or nearest_profile(sensor, tangents(points)) == scale)
    return scale if usable else NONE
