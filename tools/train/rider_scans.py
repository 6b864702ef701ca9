"""Simulated sweeps of roads with rows of parked scooters and bicycles, riders, and people beside them.

The streets of the simulator have few two-wheelers. A network that has seen no rows of them takes a row for a car.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt_simulation import kinds, scenery
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.solids import block
from modt_simulation.world import World
from modt_simulation.yard import floor
from tools.train.mounts import mounted
from tools.train.worlds import Worlds

HALF_M = 45.0
"""Half the length of the road."""
SCOOTER_SHARE = 0.7
"""Share of motor scooters among parked two-wheelers, and among those who ride."""
ROW_SHARE = 0.55
"""Share of the kerb with rows."""
RIDERS = (4, 14)
"""Least and greatest number of riders."""
PEOPLE = (4, 14)
"""Least and greatest number of people on the pavements."""
TOUCHING_M = -0.12
"""Margin around bodies: handlebars overlap in a row."""


def rider_scene(rng: Generator, height_m: float) -> World:
    """A robot or a car on a road between rows of parked two-wheelers, with riders and people."""
    builder = SceneBuilder(rng, 4.0)
    half_road_m = rng.uniform(3.0, 8.0)
    for _ in range(rng.integers(*RIDERS)):
        _rider(builder, half_road_m)
    for side in (-1, 1):
        _row(builder, side, half_road_m)
        wall_m = half_road_m + rng.uniform(3.0, 8.0)
        builder.scenery(block((2 * HALF_M, 0.4, rng.uniform(2.5, 6.0)), Material.WALL), 0.0, side * wall_m)
        for _ in range(rng.integers(*PEOPLE)):
            builder.bystander(rng.uniform(-HALF_M, HALF_M), side * rng.uniform(half_road_m - 0.5, wall_m - 0.6))
        for _ in range(rng.integers(0, 12)):
            thing = (scenery.bin_, scenery.sign, scenery.pole, scenery.tree)[rng.integers(4)](rng)
            builder.scenery(thing, rng.uniform(-HALF_M, HALF_M), side * rng.uniform(half_road_m, wall_m - 0.5))
    for _ in range(rng.integers(0, 6)):
        kind = kinds.CAR if rng.random() < 0.8 else kinds.VAN
        y = rng.uniform(-half_road_m, half_road_m)
        builder.vehicle(kind, Path.standing(rng.uniform(-HALF_M, HALF_M), y, rng.normal(0.0, 0.1)))
    material = (Material.ASPHALT, Material.PAVING)[rng.integers(2)]
    ground = floor(rng, (HALF_M, HALF_M), material, rng.uniform(0.002, 0.015))
    ego = Path.standing(0.0, 0.0, 0.0)
    return builder.world(ground, ego, height_m, sway_rad=0.004, ego_m=(1.5, 1.0), margin_m=TOUCHING_M)


def _rider(builder: SceneBuilder, half_road_m: float) -> None:
    """Add who rides along the road, either way, or waits on it."""
    rng = builder.rng
    heading = rng.normal(0.0, 0.15) + np.pi * (rng.random() < 0.5)
    x, y = rng.uniform(-HALF_M, HALF_M), rng.uniform(-half_road_m, half_road_m)
    speed = rng.uniform(2.0, 9.0)
    end = x + speed * np.cos(heading), y + speed * np.sin(heading)
    path = Path.steady(np.array([(x, y), end]), 0.0, speed, 1.0) if rng.random() < 0.7 else None
    path = path or Path.standing(x, y, heading)
    if rng.random() < SCOOTER_SHARE:
        builder.scooter_rider(path)
    else:
        builder.cyclist(path, min(speed, 5.0))


def _row(builder: SceneBuilder, side: int, half_road_m: float) -> None:
    """Add two-wheelers side by side along the kerb, and people and cars between the rows."""
    rng = builder.rng
    x = -HALF_M
    while x < HALF_M:
        length = rng.uniform(1.0, 12.0)
        draw = rng.random()
        y = side * (half_road_m + rng.uniform(-0.3, 1.0))
        if draw < ROW_SHARE:
            gap = rng.uniform(0.5, 1.0)
            slant = side * rng.uniform(0.9, 1.9)
            for along in np.arange(x, x + length, gap):
                turn = slant + rng.normal(0.0, 0.08)
                place = along + rng.normal(0.0, 0.05), y + rng.normal(0.0, 0.12), turn
                (builder.parked_scooter if rng.random() < SCOOTER_SHARE else builder.parked_bicycle)(*place)
            for _ in range(rng.integers(0, 3)):
                builder.bystander(
                    x + rng.uniform(0.0, length), y + side * rng.choice([-1, 1]) * rng.uniform(1.1, 1.7)
                )
        elif draw < ROW_SHARE + 0.15:
            builder.vehicle(kinds.CAR, Path.standing(x + 2.5, y, rng.normal(0.0, 0.03)))
            length = 5.5
        x += length + rng.uniform(0.3, 3.0)


rider_scans = Worlds(
    name="rider",
    stream=7,
    scene=rider_scene,
    height_m=(0.4, 2.2),
    usual_height_share=0.6,
    sweeps=5,
    profile=mounted,
).scans
