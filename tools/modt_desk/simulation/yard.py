"""A walled yard for small robots."""

from __future__ import annotations

import numpy as np

from modt_desk.simulation import furniture, kinds, scenery
from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.materials import Material
from modt_desk.simulation.motion import Path, timetable
from modt_desk.simulation.road import CELL_M
from modt_desk.simulation.solids import box
from modt_desk.simulation.terrain import Terrain
from modt_desk.simulation.world import World

ROBOT_MPS = (0.6, 1.4)
"""Range of the robot's speed."""


def yard(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A walled yard with a few cars, pallets, bins, bicycles and people."""
    half = (rng.uniform(18.0, 30.0), rng.uniform(14.0, 24.0))
    builder = SceneBuilder(rng, seconds)
    ego = round_trip(rng, seconds, (half[0] - 6, half[1] - 6))
    walkers(builder, half, 8)
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
            builder.scenery(furniture.pallets(rng) if make < 5 else scenery.bin_(rng), x, y, turn)
    enclose(builder, half, rng.uniform(2.0, 6.0))
    return builder.world(floor(rng, half, Material.ASPHALT, 0.01), ego, height_m, sway_rad=0.006)


def round_trip(rng: np.random.Generator, seconds: float, half: tuple[float, float]) -> Path:
    """Round trips of the robot with one stop."""
    angle = np.linspace(0, 2 * np.pi, 60) + rng.uniform(0, 2 * np.pi)
    line = np.stack([half[0] * 0.8 * np.cos(angle), half[1] * 0.8 * np.sin(angle)], axis=1)
    knots = rng.uniform(*ROBOT_MPS, 6)
    knots[3] = 0.0
    speed = np.interp(np.linspace(0, 1, 120), np.linspace(0, 1, 6), knots)
    laps = max(1, int(np.ceil(seconds * ROBOT_MPS[1] / np.linalg.norm(np.diff(line, axis=0), axis=1).sum())) + 1)
    return Path(np.concatenate([line[:1], *([line[1:]] * laps)]), *timetable(seconds, speed))


def walkers(builder: SceneBuilder, half: tuple[float, float], n: int) -> None:
    """Add n people who walk about, and half as many who stand."""
    rng = builder.rng
    for _ in range(n):
        speed = float(np.clip(rng.normal(1.2, 0.2), 0.6, 1.8))
        line = rng.uniform(-1, 1, (6, 2)) * (half[0] - 1, half[1] - 1)
        builder.pedestrian(Path.steady(line, 0.0, speed, builder.seconds), speed)
    for _ in range(n // 2):
        x, y = rng.uniform(-1, 1, 2) * (half[0] - 1, half[1] - 1)
        builder.pedestrian(Path.standing(x, y, rng.uniform(-np.pi, np.pi)))


def enclose(builder: SceneBuilder, half: tuple[float, float], height: float) -> None:
    """Add four walls."""
    for long, across, turn in ((half[0], half[1], 0.0), (half[1], half[0], np.pi / 2)):
        for side in (-1, 1):
            wall = box((0.0, 0.0, height / 2), (2 * long + 0.6, 0.3, height), Material.WALL)
            x, y = (0.0, side * (across + 0.2)) if turn == 0 else (side * (across + 0.2), 0.0)
            builder.scenery(wall, x, y, turn)


def floor(rng: np.random.Generator, half: tuple[float, float], material: int, roughness_m: float) -> Terrain:
    """Level ground of one material."""
    shape = (int(2 * (half[0] + 5) / CELL_M), int(2 * (half[1] + 5) / CELL_M))
    height = rng.standard_normal(shape, np.float32) * np.float32(roughness_m)
    return Terrain(np.array([-half[0] - 5, -half[1] - 5]), CELL_M, height, np.full(shape, material, np.uint8))
