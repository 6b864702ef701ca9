"""How alike the beams of two sensors are, and the shipped profile of the same beams."""

from __future__ import annotations

import numpy as np

from modt import assets, profile
from modt.config import SensorConfig
from modt.types import Float32

MAX_LIKENESS_RATIO = 1.2
"""Of the spacings of a shipped profile of the same beams."""
SAMPLE = 20
"""Points per one that is compared."""


def tangents(points: Float32) -> Float32:
    """(n,) tangents of the elevations of a sample of (N, 4) points; at the sensor itself, level."""
    some = points[::SAMPLE]
    range_m = np.hypot(some[:, 0], some[:, 1])
    return np.asarray(some[:, 2] / np.where(range_m > 0, range_m, np.inf), np.float32)


def spacing_ratio(a: SensorConfig, b: SensorConfig, tangent: Float32) -> float:
    """Median ratio of the spacings of two sensors' beams, the greater by the smaller, at some elevations."""
    log_ratio = np.log(a.beams.step_rad(tangent) / b.beams.step_rad(tangent))
    return float(np.exp(np.median(np.abs(log_ratio))))


def azimuth_ratio(a: SensorConfig, b: SensorConfig) -> float:
    """Of the spacings along a beam, the greater by the smaller."""
    ratio = a.azimuth_step_deg / b.azimuth_step_deg
    return max(ratio, 1 / ratio)


def nearest_profile(found: SensorConfig, tangent: Float32) -> str | None:
    """The shipped profile of the same beams, by the height of the mount where several have them."""
    best = None
    for path in sorted(assets.folder("profiles").glob("*.yaml")):
        shipped = profile.resolve(path.stem)
        if shipped.sensor is None:  # a board
            continue
        sensor = shipped.config.sensor
        if max(spacing_ratio(sensor, found, tangent), azimuth_ratio(sensor, found)) < MAX_LIKENESS_RATIO:
            away_m = abs((sensor.height_m or 0.0) - (found.height_m or 0.0))
            best = min(best or (np.inf, ""), (away_m, path.stem))
    return best[1] if best else None
