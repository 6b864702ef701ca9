"""A yard and a hall for small robots."""

from __future__ import annotations

import numpy as np

from modt_desk.simulation import kinds, scenery
from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.materials import Material
from modt_desk.simulation.motion import Path, timetable
from modt_desk.simulation.road import CELL_M
from modt_desk.simulation.solids import Solids, box, cylinder, rod
from modt_desk.simulation.terrain import Terrain
from modt_desk.simulation.world import World

ROBOT_MPS = (0.6, 1.4)
"""Range of the robot's speed."""


def yard(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A walled yard with a few cars, pallets, bins, bicycles and people."""
    half = (rng.uniform(18.0, 30.0), rng.uniform(14.0, 24.0))
    builder = SceneBuilder(rng, seconds)
    ego = _round_trip(rng, seconds, (half[0] - 6, half[1] - 6))
    _walkers(builder, half, 8)
    for _ in range(3):
        line = rng.uniform(-1, 1, (6, 2)) * (half[0] - 2, half[1] - 2)
        builder.cyclist(Path.steady(line, 0.0, 2.5, seconds), 2.5)
    for _ in range(int(rng.integers(2, 6))):
        x, y = rng.uniform(-half[0] + 3, half[0] - 3), float(rng.choice([-1, 1])) * (half[1] - 3)
        kind = kinds.CAR if rng.random() < 0.7 else kinds.VAN
        builder.vehicle(kind, Path.standing(x, y, np.pi / 2 + rng.normal(0, 0.05)))
    for _ in range(30):
        x, y, turn = rng.uniform(-half[0], half[0]), rng.uniform(-half[1], half[1]), rng.uniform(0, 7)
        make = rng.choice(6)
        if make == 0:
            builder.parked_bicycle(x, y, turn)
        elif make == 1:
            builder.scenery(scenery.tree(rng), x, y, turn)
        elif make == 2:
            builder.scenery(scenery.shrub(rng, rng.uniform(0.4, 1.2)), x, y, turn)
        else:
            builder.scenery(pallets(rng) if make < 5 else scenery.bin_(rng), x, y, turn)
    enclose(builder, half, rng.uniform(2.0, 6.0))
    return builder.world(floor(rng, half, Material.ASPHALT, 0.01), ego, height_m, sway_rad=0.006)


def hall(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A hall with pillars, tables, shelves, a ceiling and people."""
    half = (rng.uniform(9.0, 16.0), rng.uniform(7.0, 11.0))
    builder = SceneBuilder(rng, seconds)
    ego = _round_trip(rng, seconds, (half[0] - 3.5, half[1] - 3.5))
    _walkers(builder, half, 6)
    ceiling = max(rng.uniform(2.7, 4.0), height_m + 0.8)
    for x in np.arange(-half[0] + 3, half[0], 6.0):
        for side in (-1, 1):
            builder.scenery(box((0, 0, ceiling / 2), (0.4, 0.4, ceiling), Material.WALL), x, side * half[1] / 3, 0.0)
    for _ in range(24):
        x, y = rng.uniform(-half[0], half[0]), rng.uniform(-half[1], half[1])
        turn = rng.choice([0, np.pi / 2]) + rng.normal(0, 0.1)
        builder.scenery((table, chair, shelf, pallets)[rng.choice(4)](rng), x, y, turn)
    enclose(builder, half, ceiling)
    roof = box((0, 0, ceiling + 0.1), (2 * half[0], 2 * half[1], 0.2), Material.WALL)
    builder.scenery(roof, 0.0, 0.0, 0.0)
    return builder.world(floor(rng, half, Material.FLOOR, 0.002), ego, height_m, sway_rad=0.003)


def pallets(rng: np.random.Generator) -> Solids:
    """A stack of pallets or crates."""
    layers, z = int(rng.integers(1, 5)), 0.0
    parts = []
    for _ in range(layers):
        height = float(rng.choice([0.15, 0.4, 0.7]))
        shift = rng.normal(0, 0.04, 2)
        size, turn = (1.2, 0.8, height), rng.normal(0, 0.05)
        parts.append(box((shift[0], shift[1], z + height / 2), size, Material.WOOD, turn))
        z += height
    return Solids.join(parts)


def table(rng: np.random.Generator) -> Solids:
    """A table on four legs."""
    long, deep, tall = rng.uniform(1.0, 2.0), rng.uniform(0.6, 0.9), rng.uniform(0.7, 0.78)
    legs = [(i * (long / 2 - 0.05), j * (deep / 2 - 0.05)) for i in (-1, 1) for j in (-1, 1)]
    top = box((0, 0, tall), (long, deep, 0.04), Material.WOOD)
    return Solids.join([top, *(cylinder((x, y, tall / 2), 0.03, tall, Material.METAL) for x, y in legs)])


def chair(rng: np.random.Generator) -> Solids:
    """A chair."""
    corners = [(i, j) for i in (-1, 1) for j in (-1, 1)]
    legs = [rod((i * 0.2, j * 0.2, 0.0), (i * 0.18, j * 0.18, 0.45), 0.018, Material.METAL) for i, j in corners]
    back = box((-0.21, 0, 0.75), (0.04, 0.42, 0.35), Material.WOOD)
    return Solids.join([box((0, 0, 0.46), (0.45, 0.45, 0.05), Material.WOOD), back, *legs])


def shelf(rng: np.random.Generator) -> Solids:
    """Shelves with boxes on them."""
    long, tall = rng.uniform(1.0, 2.5), rng.uniform(1.4, 2.2)
    boards = [box((0, 0, z), (long, 0.4, 0.03), Material.METAL) for z in np.arange(0.1, tall, 0.4)]
    sides = [box((s * long / 2, 0, tall / 2), (0.04, 0.4, tall), Material.METAL) for s in (-1, 1)]
    things = [
        box((rng.uniform(-0.4, 0.4) * long, 0, z + 0.13), (rng.uniform(0.1, 0.5), 0.3, 0.25), Material.WOOD)
        for z in np.arange(0.1, tall, 0.4)
    ]
    return Solids.join([*boards, *sides, *things])


def _round_trip(rng: np.random.Generator, seconds: float, half: tuple[float, float]) -> Path:
    """Round trips of the robot with one stop."""
    angle = np.linspace(0, 2 * np.pi, 60) + rng.uniform(0, 2 * np.pi)
    line = np.stack([half[0] * 0.8 * np.cos(angle), half[1] * 0.8 * np.sin(angle)], axis=1)
    knots = rng.uniform(*ROBOT_MPS, 6)
    knots[3] = 0.0
    speed = np.interp(np.linspace(0, 1, 120), np.linspace(0, 1, 6), knots)
    laps = max(1, int(np.ceil(seconds * ROBOT_MPS[1] / np.linalg.norm(np.diff(line, axis=0), axis=1).sum())) + 1)
    return Path(np.concatenate([line[:1], *([line[1:]] * laps)]), *timetable(seconds, speed))


def _walkers(builder: SceneBuilder, half: tuple[float, float], n: int) -> None:
    rng = builder.rng
    for _ in range(n):
        speed = float(np.clip(rng.normal(1.2, 0.2), 0.6, 1.8))
        line = rng.uniform(-1, 1, (6, 2)) * (half[0] - 1, half[1] - 1)
        builder.pedestrian(Path.steady(line, 0.0, speed, builder.seconds), speed)
    for _ in range(n // 2):
        x, y = rng.uniform(-1, 1, 2) * (half[0] - 1, half[1] - 1)
        builder.pedestrian(Path.standing(x, y, rng.uniform(-np.pi, np.pi)))


def enclose(builder: SceneBuilder, half: tuple[float, float], height: float) -> None:
    for long, across, turn in ((half[0], half[1], 0.0), (half[1], half[0], np.pi / 2)):
        for side in (-1, 1):
            wall = box((0.0, 0.0, height / 2), (2 * long + 0.6, 0.3, height), Material.WALL)
            x, y = (0.0, side * (across + 0.2)) if turn == 0 else (side * (across + 0.2), 0.0)
            builder.scenery(wall, x, y, turn)


def floor(rng: np.random.Generator, half: tuple[float, float], material: int, roughness_m: float) -> Terrain:
    shape = (int(2 * (half[0] + 5) / CELL_M), int(2 * (half[1] + 5) / CELL_M))
    height = rng.standard_normal(shape, np.float32) * np.float32(roughness_m)
    return Terrain(np.array([-half[0] - 5, -half[1] - 5]), CELL_M, height, np.full(shape, material, np.uint8))
