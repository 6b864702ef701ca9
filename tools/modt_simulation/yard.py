"""Open ground for small robots: a walled yard, a square full of people, a ramp and a loading dock."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt.types import Float32
from modt_simulation import kinds, scenery
from modt_simulation.builder import SceneBuilder, clipped_normal
from modt_simulation.materials import Material
from modt_simulation.motion import Path, timetable
from modt_simulation.road import CELL_M
from modt_simulation.solids import Pair, block
from modt_simulation.terrain import Terrain
from modt_simulation.world import World

ROBOT_M = (0.6, 0.5)
"""Length and width of a small robot."""
ROBOT_MPS = (0.6, 1.4)
"""Range of its speed."""
SQUARE_HALF_M = (25.0, 25.0)
"""Half the sides of the square."""
SQUARE_PEOPLE = 120
"""Number of people on it."""
SLOPE_HALF_M = (40.0, 30.0)
"""Half the sides of the ground around a ramp or a dock."""
KERB_M = 0.12
"""Height of the kerb beside the ramp."""
DOCK_M = 1.1
"""Height of the loading dock."""
SLOPE_ROUGHNESS_M = 0.005
"""Standard deviation of the height of that ground."""
STEEPEST = 0.4
"""Tangent of the rays that may meet a slope."""


def yard(rng: Generator, seconds: float, height_m: float) -> World:
    """A walled yard with a few cars, pallets, bins, bicycles and people."""
    half = (rng.uniform(18.0, 30.0), rng.uniform(14.0, 24.0))
    builder = SceneBuilder(rng, seconds)
    ego = round_trip(rng, seconds, (half[0] - 6, half[1] - 6))
    walkers(builder, half, 8)
    for _ in range(3):
        line = rng.uniform(-1, 1, (6, 2)) * (half[0] - 2, half[1] - 2)
        builder.cyclist(Path.steady(line, 0.0, 2.5, seconds), 2.5)
    for _ in range(rng.integers(2, 6)):
        x = rng.uniform(-half[0] + 3, half[0] - 3)
        y = rng.choice([-1, 1]) * (half[1] - 3)
        kind = kinds.CAR if rng.random() < 0.7 else kinds.VAN
        builder.vehicle(kind, Path.standing(x, y, np.pi / 2 + rng.normal(0, 0.05)))
    for _ in range(30):
        spot = (rng.uniform(-half[0], half[0]), rng.uniform(-half[1], half[1]), rng.uniform(0, 7))
        make = rng.choice(6)
        if make == 0:
            builder.parked_bicycle(*spot)
        elif make == 2:
            builder.scenery(scenery.shrub(rng, rng.uniform(0.4, 1.2)), *spot)
        else:
            thing = scenery.tree if make == 1 else scenery.pallets if make < 5 else scenery.bin_
            builder.scenery(thing(rng), *spot)
    enclose(builder, half, rng.uniform(2.0, 6.0))
    return builder.world(floor(rng, half, Material.ASPHALT, 0.01), ego, height_m, sway_rad=0.006)


def round_trip(rng: Generator, seconds: float, half: Pair) -> Path:
    """Round trips of the robot with one stop."""
    angle = np.linspace(0, 2 * np.pi, 60) + rng.uniform(0, 2 * np.pi)
    line = np.stack([half[0] * 0.8 * np.cos(angle), half[1] * 0.8 * np.sin(angle)], axis=1)
    knots = rng.uniform(*ROBOT_MPS, 6)
    knots[3] = 0.0
    speed = np.interp(np.linspace(0, 1, 120), np.linspace(0, 1, 6), knots)
    laps = max(1, int(np.ceil(seconds * ROBOT_MPS[1] / np.linalg.norm(np.diff(line, axis=0), axis=1).sum())) + 1)
    return Path(np.concatenate([line[:1], *([line[1:]] * laps)]), *timetable(seconds, speed))


def walkers(builder: SceneBuilder, half: Pair, n: int) -> None:
    """Add n people who walk about, and half as many who stand."""
    rng = builder.rng
    for _ in range(n):
        speed = clipped_normal(rng, 1.2, 0.2, 0.6, 1.8)
        builder.walker(rng.uniform(-1, 1, (6, 2)) * (half[0] - 1, half[1] - 1), speed)
    for _ in range(n // 2):
        x, y = rng.uniform(-1, 1, 2) * (half[0] - 1, half[1] - 1)
        builder.bystander(x, y)


def enclose(builder: SceneBuilder, half: Pair, height: float) -> None:
    """Add four walls."""
    along_x = block((2 * half[0] + 0.6, 0.3, height), Material.WALL)
    along_y = block((2 * half[1] + 0.6, 0.3, height), Material.WALL)
    for side in (-1, 1):
        builder.scenery(along_x, 0.0, side * (half[1] + 0.2))
    for side in (-1, 1):
        builder.scenery(along_y, side * (half[0] + 0.2), 0.0, np.pi / 2)


def floor(rng: Generator, half: Pair, material: int, roughness_m: float) -> Terrain:
    """Level ground of one material."""
    shape = (int(2 * (half[0] + 5) / CELL_M), int(2 * (half[1] + 5) / CELL_M))
    height = rng.standard_normal(shape, np.float32) * np.float32(roughness_m)
    return Terrain(np.array([-half[0] - 5, -half[1] - 5]), CELL_M, height, np.full(shape, material, np.uint8))


def crowd(rng: Generator, seconds: float, height_m: float) -> World:
    """A walled square of 50 m with people who walk past one another and stand about; the robot drives through."""
    builder = SceneBuilder(rng, seconds)
    for _ in range(SQUARE_PEOPLE):
        x, y = rng.uniform(-24.0, 24.0, 2)
        bearing = rng.uniform(-np.pi, np.pi)
        if rng.random() < 0.6:
            builder.walker([(x, y), (x + 60.0 * np.cos(bearing), y + 60.0 * np.sin(bearing))], 1.2)
        else:
            builder.pedestrian(Path.standing(x, y, bearing))
    enclose(builder, SQUARE_HALF_M, 3.0)
    ego = Path.steady([(-8.0, 0.0), (8.0, 0.0)], 0.0, 0.8, seconds)
    return builder.world(floor(rng, SQUARE_HALF_M, Material.PAVING, 0.005), ego, height_m, ego_m=ROBOT_M)


def ramp(rng: Generator, seconds: float, height_m: float) -> World:
    """Flat ground with a kerb to the left, and a ramp 10 m long across the way, 4 m ahead, with people."""
    slope_deg = rng.uniform(6.0, 15.0)
    x, y = _grid()
    height = np.clip(x - 4.0, 0, 10.0) * np.float32(np.tan(np.deg2rad(slope_deg))) + np.float32(KERB_M) * (y > 6.0)
    builder = SceneBuilder(rng, seconds)
    for nearest, farthest, way in ((2.5, 4.0, 1), (5.0, 7.0, 1), (7.0, 10.0, 1), (10.0, 13.5, 1), (5.0, 12.0, -1)):
        at = rng.uniform(nearest, farthest) * way
        builder.bystander(at, rng.uniform(0.8, 4.0) * rng.choice([-1, 1]))
    builder.walker([(13.0, 2.0), (-10.0, 2.0)], 1.0)
    ego = Path.steady([(-3.0, 0.0), (3.5, 0.0)], 0.0, 1.0, seconds)
    return builder.world(_sloping(rng, height), ego, height_m, ego_m=ROBOT_M)


def dock(rng: Generator, seconds: float, height_m: float) -> World:
    """A loading dock: a platform with a sheer edge and a ramp 4 m wide up to it; people below and on the ramp."""
    x, y = _grid()
    on_ramp = np.clip((x - 2.0) / 8.0, 0, 1) * np.float32(DOCK_M)
    height = np.where(np.abs(y) < 2.0, on_ramp, np.float32(DOCK_M) * (x > 10.0)).astype(np.float32)
    builder = SceneBuilder(rng, seconds)
    for place in ((4.0, 1.0), (8.0, -1.0), (7.0, 4.0), (5.0, -5.0), (-6.0, 3.0)):
        at, left = place + rng.uniform(-0.5, 0.5, 2)
        builder.bystander(at, left)
    ego = Path.steady([(-5.0, 0.0), (9.5, 0.0)], 0.0, 1.0, seconds)
    return builder.world(_sloping(rng, height), ego, height_m, ego_m=ROBOT_M)


def _grid() -> tuple[Float32, Float32]:
    """(X, 1) x and (1, Y) y of the cells of a terrain."""
    x, y = (np.arange(-half, half, CELL_M, dtype=np.float32) + np.float32(CELL_M / 2) for half in SLOPE_HALF_M)
    return x[:, None], y[None]


def _sloping(rng: Generator, height: Float32) -> Terrain:
    rough = height + rng.standard_normal(height.shape, np.float32) * np.float32(SLOPE_ROUGHNESS_M)
    material = np.full(height.shape, Material.ASPHALT, np.uint8)
    return Terrain(-np.array(SLOPE_HALF_M), CELL_M, rough.astype(np.float32), material, STEEPEST)
