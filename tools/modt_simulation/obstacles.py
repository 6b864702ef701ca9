"""Places and movers at which obstacles are easily lost: close to walls, low, long, in grass, on uneven ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from modt.types import Float64
from modt_simulation import belongings, kinds, scenery
from modt_simulation.builder import MARGIN_M, SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.movers import MAKERS, Mover, forklift
from modt_simulation.solids import Solids, block, ellipsoid
from modt_simulation.terrain import Terrain
from modt_simulation.vehicles import car_size, open_door
from modt_simulation.world import Body, World
from modt_simulation.yard import ROBOT_M, enclose, floor, walkers

HALF_M = (30.0, 30.0)
"""Half the sides of the ground."""
TOUCHING_M = -0.1
"""Margin around bodies of which some touch."""
GAPS_M = (0.05, 0.2, 0.5)
"""Gaps between people and a wall."""
DOORWAYS_M = (0.9, 1.0, 1.2)
"""Widths of doorways."""
SHOULDER_M = 0.3
"""Half the breadth of a person."""
BACK_M = 0.2
"""Half the depth of a person."""
STEEPEST = 1.0
"""Tangent of the rays that may meet hills and stairs."""
RISER_M, TREAD_M = 0.17, 0.3
"""Height and depth of a step of the stairs."""
REACH_M = 60.0
"""Half the length of the ways of the robot and of movers."""
SPEED_MPS = 0.4
"""Speed of the robot."""
ROUGHNESS_M = {Material.PAVING: 0.01, Material.ASPHALT: 0.01, Material.GRASS: 0.03}
"""Standard deviation of the height of level ground."""


def wall(rng: Generator, seconds: float, height_m: float) -> World:
    """People along a wall, in a doorway, between parked cars, at a car's door, and in a queue."""
    builder = SceneBuilder(rng, seconds)
    left = rng.uniform(3.5, 5.0)
    builder.scenery(block((50.0, 0.3, rng.uniform(2.3, 3.2)), Material.WALL), 0.0, left + 0.15)
    pace = rng.uniform(0.8, 1.2)
    for k, gap in enumerate(rng.permutation(GAPS_M).tolist()):
        x = 4.0 * k + rng.uniform(-3.0, -2.0)
        along = left - gap - SHOULDER_M
        builder.walker([(x, along), (x + 40.0, along)], pace, role=f"walks {gap:g} m from a wall")
        place = Path.standing(rng.uniform(-6.0, -4.5) - 2.0 * k, left - gap - BACK_M, -np.pi / 2)
        builder.pedestrian(place, role=f"stands {gap:g} m from a wall")
    _doorway(builder, rng.uniform(6.0, 9.0))
    _row_of_cars(builder, -rng.uniform(3.5, 4.5))
    apart = rng.uniform(0.65, 0.9)
    for k in range(4):
        builder.pedestrian(Path.standing(-3.5 - k * apart, rng.normal(0.0, 0.1), 0.0), role="in a queue")
    return level_world(builder, Material.PAVING, height_m, TOUCHING_M)


def _doorway(builder: SceneBuilder, x: float) -> None:
    """A wall across the way, a metre to both sides of its opening, and a person in it."""
    width = builder.rng.choice(DOORWAYS_M)
    for side in (-1, 1):
        builder.scenery(block((0.2, 1.0, 2.5), Material.WALL), x, side * (1.0 + width) / 2)
    place = Path.standing(x, builder.rng.uniform(-0.1, 0.1), np.pi)
    builder.pedestrian(place, role=f"in a doorway of {width:g} m")


def _row_of_cars(builder: SceneBuilder, y: float) -> None:
    """Four cars, one behind the other, with a person in each gap and one at the last one's door, open or not."""
    rng = builder.rng
    x = rng.uniform(-11.0, -8.0)
    for gap in (0.7, 1.0, 1.6, 0.0):
        size = car_size(rng)
        middle = x + size[0] / 2
        builder.vehicle(kinds.CAR, Path.standing(middle, y, 0.0), size)
        x += size[0] + gap
        if gap:
            builder.pedestrian(Path.standing(x - gap / 2, y + rng.uniform(-0.2, 0.2), np.pi / 2), role="between cars")
    role = "at a car's door"
    if rng.random() < 0.5:
        role = "at a car's open door"
        car = builder.bodies[-1]
        builder.bodies[-1] = replace(car, solids=Solids.join([car.solids, open_door(rng, size)]))
    place = Path.standing(middle + rng.uniform(0.0, 0.3), y + size[1] / 2 + rng.uniform(0.18, 0.35), -np.pi / 2)
    builder.pedestrian(place, role=role)


def grass(rng: Generator, seconds: float, height_m: float) -> World:
    """People in tall grass, through which a mown path leads."""
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (9.0, 9.0), 4)
    tall = rng.uniform(0.2, 0.5)
    tufts = [
        block((1.0, 1.0, tall * rng.uniform(0.5, 1.1)), Material.FOLIAGE, x, y, rng.uniform(1.5, 6.0))
        for x in np.arange(-14.0, 14.5)
        for y in np.arange(-14.0, 14.5)
        if abs(y) > 1.0
    ]
    builder.scenery(Solids.join(tufts), 0.0, 0.0)
    return level_world(builder, Material.GRASS, height_m)


def hedges(rng: Generator, seconds: float, height_m: float) -> World:
    """Hedges and trees, some with low branches, and people between them."""
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (9.0, 3.5), 4)
    for side in (-1, 1):
        for x in np.arange(-20.0, 20.0, 5.0):
            builder.scenery(scenery.hedge(rng, 5.0), x, 5.0 * side + rng.normal(0.0, 0.3))
    for _ in range(14):
        y = rng.choice([-1, 1]) * rng.uniform(1.8, 9.0)
        builder.scenery(scenery.tree(rng), rng.uniform(-15.0, 15.0), y)
    return level_world(builder, Material.GRASS, height_m)


def heaps(rng: Generator, seconds: float, height_m: float) -> World:
    """Heaps of gravel, and people between them."""
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (9.0, 9.0), 4)
    for _ in range(24):
        wide = rng.uniform(0.5, 2.2)
        heap = ellipsoid(
            (0.0, 0.0, 0.0), (wide, wide * rng.uniform(0.7, 1.2), rng.uniform(0.4, 1.6)), Material.ASPHALT
        )
        builder.scenery(heap, *_around(rng, 4.0, 18.0))
    return level_world(builder, Material.PAVING, height_m)


def hills(rng: Generator, seconds: float, height_m: float) -> World:
    """Rolling ground with people on it."""
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (12.0, 12.0), 6)
    tall = rng.uniform(0.4, 1.1)
    wave = 2 * np.pi / rng.uniform(15.0, 22.0)
    phase = rng.uniform(0, 2 * np.pi, 2)
    ground = uneven_ground(
        rng, lambda x, y: tall * np.sin(wave * x + phase[0]) * np.cos(wave * y + phase[1]), 0.25, 0.02, Material.GRASS
    )
    return world_on(builder, ground, height_m)


def stairs(rng: Generator, seconds: float, height_m: float) -> World:
    """Stairs up ahead, stairs down to the right, a kerb to the left, and people on all of them."""
    foot = rng.uniform(5.0, 7.0)
    edge = rng.uniform(2.5, 3.5)

    def height(x: Float64, y: Float64) -> Float64:
        up = RISER_M * np.clip(np.floor((x - foot) / TREAD_M) + 1, 0, 9) * (np.abs(y) < 4.0)
        down = RISER_M * np.clip(np.floor((-y - edge) / TREAD_M) + 1, 0, 9)
        return np.asarray(up - down + 0.12 * (y > 4.0))

    builder = SceneBuilder(rng, seconds)
    builder.walker([(foot + 3.0, -1.0), (foot - 4.0, -1.0)], 0.7, role="on stairs")
    builder.walker([(0.0, -edge - 3.0), (0.0, -1.5)], 0.6, role="on stairs")
    builder.bystander(foot + 0.75, rng.uniform(0.5, 2.0))
    builder.bystander(rng.uniform(1.0, 3.0), -edge - 3.5)
    builder.bystander(rng.uniform(-4.0, 0.0), 5.0)
    ground = uneven_ground(rng, height, 0.1, 0.004, Material.PAVING)
    return world_on(builder, ground, height_m)


def movers(rng: Generator, seconds: float, height_m: float) -> World:
    """Six movers of no class that pass the robot on all sides, among trees, poles and bins."""
    builder = SceneBuilder(rng, seconds)
    bearing = rng.uniform(-np.pi, np.pi)
    for k, maker in enumerate(rng.choice(len(MAKERS), 6, replace=False).tolist()):
        mover = MAKERS[maker](rng)
        distance = rng.uniform(6.0 if mover.size[0] > 1.5 else 3.0, 9.0)
        _passing(builder, mover, MAKERS[maker].__name__, distance, bearing + k * np.pi / 3)
    makers = (scenery.tree, scenery.pole, scenery.bin_, scenery.pallets)
    for k in range(16):
        builder.scenery(makers[k % 4](rng), *_around(rng, 12.0, 28.0))
    return level_world(builder, Material.ASPHALT, height_m, TOUCHING_M)


def loading(rng: Generator, seconds: float, height_m: float) -> World:
    """Forklifts that pass the robot or stand, among parked cars, people, pallets and bins."""
    builder = SceneBuilder(rng, seconds)
    bearing = rng.uniform(-np.pi, np.pi)
    for k in range(4):
        _passing(builder, forklift(rng), "forklift", rng.uniform(4.0, 18.0), bearing + k * np.pi / 2)
    for _ in range(6):
        standing = forklift(rng)
        path = Path.standing(*_around(rng, 5.0, 28.0))
        builder.bodies.append(Body(standing.kind, standing.size, path, standing.solids, "forklift that stands"))
    for _ in range(3):
        builder.vehicle(kinds.CAR, Path.standing(*_around(rng, 7.0, 25.0)))
    for _ in range(5):
        x, y, _ = _around(rng, 3.0, 20.0)
        builder.bystander(x, y)
    makers = (scenery.pallets, scenery.bin_, scenery.pole)
    for k in range(12):
        builder.scenery(makers[k % 3](rng), *_around(rng, 5.0, 28.0))
    return level_world(builder, Material.ASPHALT, height_m)


def _passing(builder: SceneBuilder, mover: Mover, name: str, distance_m: float, bearing_rad: float) -> None:
    """Add a mover that is nearest to the origin at half time, at a distance in a direction."""
    towards = np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    across = np.array([-towards[1], towards[0]])
    line = [distance_m * towards - REACH_M * across, distance_m * towards + REACH_M * across]
    speed_mps = mover.speed_mps
    start = REACH_M - speed_mps * builder.seconds / 2
    path = Path.steady(line, start, speed_mps, builder.seconds)
    if mover.rider is not None:
        builder.rider(mover.kind, mover.size, path, mover.solids, mover.rider, name)
        return
    builder.bodies.append(Body(mover.kind, mover.size, path, mover.solids, name))
    if mover.pusher_m:
        builder.walker(line, speed_mps, start - mover.pusher_m, f"pushes a {name}")


def vines(rng: Generator, seconds: float, height_m: float) -> World:
    """Rows of vines at stakes, along and beside the way of the robot, and people between them."""
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (9.0, 9.0), 2)
    for y in np.arange(-4.5, 5.0, 3.0):
        for x in np.arange(-15.0, 15.0, 1.2):
            builder.scenery(belongings.stake(rng), x, y + rng.normal(0.0, 0.1))
    return level_world(builder, Material.GRASS, height_m)


def scooters(rng: Generator, seconds: float, height_m: float) -> World:
    """Rows of parked motor scooters on both sides, and people between them."""
    builder = SceneBuilder(rng, seconds)
    walkers(builder, (9.0, 9.0), 2)
    for y in (-4.0, 4.0):
        for x in np.arange(-15.0, 15.0, rng.uniform(0.7, 0.95)):
            builder.parked_scooter(x, y + rng.normal(0.0, 0.15), rng.normal(np.pi / 2, 0.12))
    return level_world(builder, Material.ASPHALT, height_m, TOUCHING_M)


def clutter(rng: Generator, seconds: float, height_m: float) -> World:
    """Logs, boxes and low walls, knee-high at most, most of them nearer than the ground that the robot sees."""
    builder = SceneBuilder(rng, seconds)
    for _ in range(10):
        size = rng.uniform(0.2, 4.0), rng.uniform(0.15, 0.8), rng.uniform(0.2, 0.55)
        path = Path.standing(*_around(rng, 1.2, 5.0))
        builder.bodies.append(Body(kinds.OTHER, size, path, block(size, Material.WOOD), "low thing"))
    enclose(builder, (18.0, 18.0), 3.0)
    return level_world(builder, Material.PAVING, height_m)


def _around(rng: Generator, nearest_m: float, farthest_m: float) -> tuple[float, float, float]:
    """Place x, y [m] and heading [rad], at a random distance from the origin in any direction."""
    distance = rng.uniform(nearest_m, farthest_m)
    bearing = rng.uniform(-np.pi, np.pi)
    return distance * np.cos(bearing), distance * np.sin(bearing), rng.uniform(-np.pi, np.pi)


def level_world(builder: SceneBuilder, material: Material, height_m: float, margin_m: float = MARGIN_M) -> World:
    """World of level ground, rough by its material."""
    ground = floor(builder.rng, HALF_M, material, ROUGHNESS_M[material])
    return world_on(builder, ground, height_m, margin_m)


def world_on(builder: SceneBuilder, ground: Terrain, height_m: float, margin_m: float = MARGIN_M) -> World:
    """World in which the robot drives slowly and passes the origin at half time."""
    start = REACH_M - SPEED_MPS * builder.seconds / 2
    ego = Path.steady([(-REACH_M, 0.0), (REACH_M, 0.0)], start, SPEED_MPS, builder.seconds)
    return builder.world(ground, ego, height_m, ego_m=ROBOT_M, margin_m=margin_m)


def uneven_ground(
    rng: Generator,
    height: Callable[[Float64, Float64], Float64],
    cell_m: float,
    roughness_m: float,
    material: Material,
) -> Terrain:
    """Terrain of a height over x and y [m, world], in cells with a random roughness."""
    middle = np.arange(-HALF_M[0] + cell_m / 2, HALF_M[0], cell_m)
    level = height(middle[:, None], middle[None])
    level += rng.standard_normal(level.shape) * roughness_m
    surface = np.full(level.shape, material, np.uint8)
    return Terrain(-np.array(HALF_M), cell_m, level.astype(np.float32), surface, STEEPEST)
