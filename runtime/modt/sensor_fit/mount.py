"""Height of the sensor above the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.config import SensorConfig
from modt.geometry.field_of_view import BlindSectors
from modt.sensor_fit.tilt import find_floor
from modt.types import Float32


def ground_height_m(sweeps: Sequence[Float32], sensor: SensorConfig) -> float | None:
    """Height above the floor, median over level sweeps of (N, 4) points [m]; None where none shows one."""
    sectors = BlindSectors(sensor.blind_sectors_deg or (), sensor.blind_range_m)
    heights_m = []
    for points in sweeps:
        kept = points[(np.hypot(points[:, 0], points[:, 1]) > sensor.min_range_m) & ~sectors.contain(points)]
        floor = find_floor(kept)
        if floor is not None and floor.up[2] > 0:
            heights_m.append(floor.depth_m)
    return float(np.median(heights_m)) if heights_m else None
