"""Height of the sensor above the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry.field_of_view import BlindSectors
from modt.segmentation.ground import HeightEstimator
from modt.types import Float32, Float64

GROUND_REACH_M = 12.0
SECTORS, RING_STEP = 128, 0.15  # of the cells whose lowest returns are used; step of the root of range
NEAR_PLANE_M = (0.3, 0.15, 0.1)  # returns that count, in each round of the fit
MIN_CELLS = 20


def ground_height_m(sweeps: Sequence[Float32], sensor: SensorConfig, config: SegmentationConfig) -> float | None:
    """Height above the ground below the sensor, median over sweeps of (N, 4) points [m]; None without flat ground.

    A plane through the ground, from the mode of the depths on: without it camber and slope bias the mode.
    """
    sectors = BlindSectors(sensor.blind_sectors_deg or (), sensor.blind_range_m)
    heights_m = []
    for points in sweeps:
        kept = points[~sectors.contain(points)] if len(sectors.bounds_deg) else points
        estimator = HeightEstimator(sensor, config)
        mode_m = estimator.height_m(kept)
        if estimator.estimates_m:
            heights_m.append(_plane_height_m(kept, mode_m, sensor.min_range_m))
    return float(np.median(heights_m)) if heights_m else None


def _plane_height_m(points: Float32, mode_m: float, min_range_m: float) -> float:
    range_m = np.hypot(points[:, 0], points[:, 1])
    around = (range_m > min_range_m) & (range_m < GROUND_REACH_M) & (points[:, 2] < 0)
    lowest = _lowest(points[around, :3].astype(np.float64), range_m[around])
    level, z = np.column_stack([np.ones(len(lowest)), lowest[:, :2]]), lowest[:, 2]
    plane = np.array([-mode_m, 0.0, 0.0])
    for near_m in NEAR_PLANE_M:
        ground = np.abs(z - (level * plane).sum(axis=1)) < near_m
        if ground.sum() < MIN_CELLS:
            break
        own = level[ground]  # sums without BLAS, which would start threads
        normal, right = (own[:, :, None] * own[:, None]).sum(axis=0), (own * z[ground, None]).sum(axis=0)
        plane = np.linalg.solve(normal, right)
    return -float(plane[0])


def _lowest(points: Float64, range_m: Float32) -> Float64:
    """(C, 3) lowest point of each cell of a polar grid."""
    sector = ((np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) % 1) * SECTORS).astype(np.int64)
    cell = (np.sqrt(range_m) / RING_STEP).astype(np.int64) * SECTORS + sector
    order = np.lexsort((points[:, 2], cell))
    first = np.append(True, np.diff(cell[order]) > 0)[: len(order)]
    return np.asarray(points[order[first]])
