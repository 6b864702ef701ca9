"""A square full of people."""

from __future__ import annotations

import numpy as np

from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.indoors import ROBOT_M
from modt_desk.simulation.materials import Material
from modt_desk.simulation.motion import Path
from modt_desk.simulation.world import World
from modt_desk.simulation.yard import enclose, floor

HALF_M = (25.0, 25.0)
PEOPLE = 120


def crowd(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A walled square of 50 m with people who walk past one another and stand about; the robot drives through."""
    builder = SceneBuilder(rng, seconds)
    for _ in range(PEOPLE):
        at, bearing = rng.uniform(-24.0, 24.0, 2), rng.uniform(-np.pi, np.pi)
        if rng.random() < 0.6:
            line = np.array([at, at + 60.0 * np.array([np.cos(bearing), np.sin(bearing)])])
            builder.pedestrian(Path.steady(line, 0.0, 1.2, seconds), 1.2)
        else:
            builder.pedestrian(Path.standing(at[0], at[1], bearing))
    enclose(builder, HALF_M, 3.0)
    ego = Path.steady(np.array([[-8.0, 0.0], [8.0, 0.0]]), 0.0, 0.8, seconds)
    return builder.world(floor(rng, HALF_M, Material.PAVING, 0.005), ego, height_m, ego_m=ROBOT_M)
