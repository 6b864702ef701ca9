"""Profiles of sensors on mounts of any height."""

from __future__ import annotations

from dataclasses import replace

from modt import profile
from modt.config import ProfileConfig

MIN_RANGE_M = 0.2
"""Nearest range used."""
LOW_M = 0.5
"""Height of the mount below which a sensor is low."""
LOW_CLEARANCE_M = 0.12
"""Least height above the ground of a point of an object, for a low sensor."""


def mounted(sensor: str, height_m: float) -> ProfileConfig:
    """The profile of a sensor, for a mount at this height on a small robot."""
    config = profile.load(sensor)
    stage = config.segmentation
    low = replace(stage, clearance_m=min(stage.clearance_m, LOW_CLEARANCE_M)) if height_m < LOW_M else stage
    mount = replace(config.sensor, height_m=height_m, min_range_m=MIN_RANGE_M)
    return replace(config, sensor=mount, segmentation=low)
