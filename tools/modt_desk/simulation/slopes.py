"""Ground that rises: a ramp ahead of the robot."""

from __future__ import annotations

import numpy as np

from modt.types import Float32
from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.indoors import ROBOT_M
from modt_desk.simulation.materials import Material
from modt_desk.simulation.motion import Path
from modt_desk.simulation.road import CELL_M
from modt_desk.simulation.terrain import Terrain
from modt_desk.simulation.world import World

HALF_M = (40.0, 30.0)
KERB_M = 0.12
ROUGHNESS_M = 0.005
STEEPEST = 0.4
"""Tangent of the rays that may meet a slope."""


def ramp(rng: np.random.Generator, seconds: float, height_m: float, slope_deg: float | None = None) -> World:
    """Flat ground with a kerb to the left, and a ramp 10 m long across the way, 4 m ahead; people before and on it.

    The slope is 6 to 15 degrees where none is given.
    """
    slope_deg = rng.uniform(6.0, 15.0) if slope_deg is None else slope_deg
    x, y = _grid()
    height = np.clip(x - 4.0, 0, 10.0) * np.float32(np.tan(np.deg2rad(slope_deg))) + np.float32(KERB_M) * (y > 6.0)
    builder = SceneBuilder(rng, seconds)
    for ahead, behind in (
        ((2.5, 4.0), False),
        ((5.0, 7.0), False),
        ((7.0, 10.0), False),
        ((10.0, 13.5), False),
        ((5.0, 12.0), True),
    ):
        at = rng.uniform(*ahead) * (-1 if behind else 1)
        builder.pedestrian(Path.standing(at, rng.uniform(0.8, 4.0) * rng.choice([-1, 1]), rng.uniform(-np.pi, np.pi)))
    line = np.array([[13.0, 2.0], [-10.0, 2.0]])
    builder.pedestrian(Path.steady(line, 0.0, 1.0, seconds), 1.0)
    ego = Path.steady(np.array([[-3.0, 0.0], [3.5, 0.0]]), 0.0, 1.0, seconds)
    return builder.world(_terrain(rng, height), ego, height_m, ego_m=ROBOT_M)


def _grid() -> tuple[Float32, Float32]:
    """(X, 1) x and (1, Y) y of the cells of a terrain."""
    x, y = (np.arange(-half, half, CELL_M, dtype=np.float32) + np.float32(CELL_M / 2) for half in HALF_M)
    return x[:, None], y[None]


def _terrain(rng: np.random.Generator, height: Float32) -> Terrain:
    rough = height + rng.standard_normal(height.shape, np.float32) * np.float32(ROUGHNESS_M)
    material = np.full(height.shape, Material.ASPHALT, np.uint8)
    return Terrain(-np.array(HALF_M), CELL_M, rough.astype(np.float32), material, STEEPEST)
