"""Ground as piece-wise planes: one height a polar cell, bounded in slope from cell to cell outwards."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.types import Float32

SECTORS = 72
RING_M = 2.0


def height_above_ground(points: Float32, sensor: SensorConfig, config: SegmentationConfig) -> Float32:
    """(N,) height of each point above the ground beneath it [m].

    The lowest returns of a polar cell stand for its ground as long as it is reachable from the cell before it at
    the permitted slope; a cell without such returns continues its neighbour.
    """
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    rho = np.hypot(x, y)
    rings = int(np.ceil(sensor.max_range_m / RING_M)) + 1
    ring = np.minimum((rho / RING_M).astype(np.int32), rings - 1)
    sector = ((np.arctan2(y, x) + np.float32(np.pi)) * np.float32(SECTORS / (2 * np.pi))).astype(np.int32) % SECTORS
    cell = ring * SECTORS + sector
    start = np.float32(-(sensor.height_m or 1.73))
    step = np.float32(RING_M * np.tan(np.deg2rad(config.max_slope_deg)))
    plausible = np.flatnonzero(np.abs(z - start) < 0.3 + np.tan(np.deg2rad(config.max_slope_deg)) * rho)
    lowest = np.full(rings * SECTORS, np.inf, np.float32)
    np.minimum.at(lowest, cell[plausible], z[plausible])
    grid = lowest.reshape(rings, SECTORS)
    ground = np.empty((rings, SECTORS), np.float32)
    below = np.full(SECTORS, start, np.float32)
    for r in range(rings):  # rings, not points: forty short steps
        below = np.where(np.abs(grid[r] - below) < step, grid[r], below)
        ground[r] = below
    return z - ground.ravel()[cell]
