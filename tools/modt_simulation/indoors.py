"""Rooms under a ceiling: a hall, a corridor, a lobby, the cabin of a lift, a warehouse and a car park."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt_simulation import kinds, scenery
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.solids import Pair, block, box, rod
from modt_simulation.world import World
from modt_simulation.yard import ROBOT_M, enclose, floor, round_trip, walkers

OVER_SENSOR_M = 0.8
"""Least distance between a sensor and the ceiling."""
OVER_BEAMS_M = 0.25
"""Least distance between a sensor and the ceiling of a car park."""
SWAY_RAD = 0.003


def hall(rng: Generator, seconds: float, height_m: float) -> World:
    """A hall with pillars, tables, shelves, glass, a ceiling and people."""
    half = (rng.uniform(9.0, 16.0), rng.uniform(7.0, 11.0))
    builder = SceneBuilder(rng, seconds)
    ego = round_trip(rng, seconds, (half[0] - 3.5, half[1] - 3.5))
    walkers(builder, half, 6)
    ceiling = max(rng.uniform(2.3, 3.5), height_m + OVER_SENSOR_M)
    for x in np.arange(-half[0] + 3, half[0], 6.0):
        for side in (-1, 1):
            builder.scenery(block((0.4, 0.4, ceiling), Material.WALL), x, side * half[1] / 3)
    _furnish(builder, half, 24)
    for _ in range(3):
        x, y = rng.uniform(-0.8, 0.8, 2) * half
        builder.scenery(scenery.pane(rng, ceiling), x, y, rng.choice([0, np.pi / 2]))
    return _under(builder, half, ceiling, ego, height_m)


def corridor(rng: Generator, seconds: float, height_m: float) -> World:
    """A corridor with doors and boxes along its walls; people walk along it and stand at the walls."""
    half = (22.0, rng.uniform(1.0, 1.4))
    ceiling = max(rng.uniform(2.3, 3.0), height_m + OVER_SENSOR_M)
    builder = SceneBuilder(rng, seconds)
    for side in (-1, 1):
        pace = rng.uniform(0.8, 1.4)
        start = rng.uniform(6.0, 16.0) * side
        builder.walker([(start, side * 0.45), (start - side * 40.0, side * 0.45)], pace)
    for _ in range(4):
        x = rng.uniform(3.0, 18.0) * rng.choice([-1, 1])
        builder.bystander(x, rng.choice([-1, 1]) * (half[1] - 0.4))
    for x in np.arange(-20.0, 20.0, 4.0):
        builder.scenery(scenery.door(), x, half[1] - 0.04)
        if rng.random() < 0.3:
            builder.scenery(scenery.pane(rng, 2.1), x + 2.0, -half[1] + 0.04)
        elif rng.random() < 0.4:
            builder.scenery(block((0.5, 0.4, 0.8), Material.WOOD), x + 2.0, -half[1] + 0.3)
    ego = Path.steady([(-3.0, -0.1), (12.0, -0.1)], 0.0, 0.8, seconds)
    return _under(builder, half, ceiling, ego, height_m)


def lobby(rng: Generator, seconds: float, height_m: float) -> World:
    """An entrance with a glass front, a counter, seats and people."""
    half = (rng.uniform(6.0, 9.0), rng.uniform(5.0, 7.0))
    ceiling = max(rng.uniform(2.3, 3.5), height_m + OVER_SENSOR_M)
    builder = SceneBuilder(rng, seconds)
    ego = Path.steady([(-half[0] + 2, 0.0), (half[0] - 2, 0.0)], 0.0, 0.7, seconds)
    walkers(builder, half, 4)
    for x in np.arange(-half[0] + 1, half[0], 2.0):
        builder.scenery(scenery.pane(rng, ceiling), x, half[1] - 0.3)
    builder.scenery(block((3.0, 0.7, 1.1), Material.WOOD), 0.0, -half[1] + 1.5)
    _furnish(builder, half, 8)
    return _under(builder, half, ceiling, ego, height_m)


def lift(rng: Generator, seconds: float, height_m: float) -> World:
    """The cabin of a lift with its door open to a lobby; the robot stands in it, people walk and wait outside."""
    half = (6.0, 4.0)
    deep = rng.uniform(0.8, 1.1)
    wide = rng.uniform(0.7, 0.9)
    low = max(2.3, height_m + OVER_SENSOR_M)
    ceiling = max(rng.uniform(2.4, 3.0), height_m + OVER_SENSOR_M)
    builder = SceneBuilder(rng, seconds)
    back = -half[0] + deep
    for side in (-1, 1):
        builder.scenery(block((2 * deep, 0.1, low), Material.METAL), back, side * (wide + 0.05))
        beside_door = block((0.1, half[1] - wide, low), Material.WALL)
        builder.scenery(beside_door, back + deep, side * (half[1] + wide) / 2)
    roof = box((0, 0, low + 0.05), (2 * deep, 2 * wide, 0.1), Material.METAL)
    builder.scenery(roof, back, 0.0)
    for _ in range(3):
        x = rng.uniform(back + deep + 1.0, half[0] - 0.5)
        builder.bystander(x, rng.uniform(-2.0, 2.0))
    builder.walker([(half[0] - 0.5, 0.5), (back + deep + 0.5, -0.3)], 0.8)
    return _under(builder, half, ceiling, Path.standing(back, 0.0, 0.0), height_m)


def warehouse(rng: Generator, seconds: float, height_m: float) -> World:
    """Aisles between tall racks under a high roof, pallets, a lorry's gate, and people who walk and pick."""
    half = (22.0, 14.0)
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (20.0, 2.0), 4)
    for y in (-11.0, -5.0, 5.0, 11.0):
        for x in np.arange(-16.0, 17.0, 4.0):
            builder.scenery(scenery.rack(rng), x, y)
    for _ in range(4):
        x = rng.uniform(-14.0, 14.0)
        y = rng.choice([-1, 1]) * rng.uniform(2.5, 3.8)
        builder.pedestrian(Path.standing(x, y, rng.choice([-1, 1]) * np.pi / 2))
    for _ in range(8):
        builder.scenery(scenery.pallets(rng), rng.uniform(-18.0, 18.0), rng.choice([-1, 1]) * 3.0, rng.normal(0, 0.2))
    ego = Path.steady([(-14.0, 0.0), (14.0, 0.0)], 0.0, 1.0, seconds)
    return _under(builder, half, rng.uniform(5.0, 8.0), ego, height_m)


def carpark(rng: Generator, seconds: float, height_m: float) -> World:
    """A low car park: parked cars between pillars, people, and beams and pipes under the ceiling."""
    half = (18.0, 9.5)
    ceiling = max(rng.uniform(2.0, 2.3), height_m + OVER_BEAMS_M)
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (12.0, 3.0), 5)
    for side in (-1, 1):
        for x in np.arange(-15.0, 16.0, 5.0):
            builder.scenery(block((0.4, 0.4, ceiling), Material.WALL), x, 3.7 * side)
        for x in np.arange(-16.25, 17.0, 2.5):
            if rng.random() < 0.6:
                builder.vehicle(kinds.CAR, Path.standing(x, 6.6 * side, side * np.pi / 2 + rng.normal(0, 0.03)))
        beam = box((0.0, 0.0, ceiling - 0.15), (2 * half[0], 0.3, 0.3), Material.WALL)
        builder.scenery(beam, 0.0, 3.7 * side, overhead=True)
        under_ceiling = ceiling - rng.uniform(0.08, 0.2)
        pipe = rod((-half[0], 0.0, under_ceiling), (half[0], 0.0, under_ceiling), 0.06, Material.METAL)
        builder.scenery(pipe, 0.0, rng.uniform(0.5, 3.0) * side, overhead=True)
    ego = Path.steady([(-4.0, 0.0), (10.0, 0.0)], 0.0, 0.6, seconds)
    return _under(builder, half, ceiling, ego, height_m)


def _furnish(builder: SceneBuilder, half: Pair, n: int) -> None:
    rng = builder.rng
    makers = (scenery.table, scenery.chair, scenery.shelf, scenery.pallets)
    for _ in range(n):
        x = rng.uniform(-half[0], half[0])
        y = rng.uniform(-half[1], half[1])
        turn = rng.choice([0, np.pi / 2]) + rng.normal(0, 0.1)
        builder.scenery(makers[rng.choice(4)](rng), x, y, turn)


def _under(builder: SceneBuilder, half: Pair, ceiling_m: float, ego: Path, height_m: float) -> World:
    """The world of a room with four walls, a floor and a ceiling."""
    enclose(builder, half, ceiling_m)
    roof = box((0, 0, ceiling_m + 0.1), (2 * half[0] + 0.8, 2 * half[1] + 0.8, 0.2), Material.WALL)
    builder.scenery(roof, 0.0, 0.0, overhead=True)
    ground = floor(builder.rng, half, Material.FLOOR, 0.002)
    return builder.world(ground, ego, height_m, sway_rad=SWAY_RAD, ego_m=ROBOT_M)
