"""Simulated sweeps of people and things within arm's length of a low sensor, as labelled scans."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from numpy.random import Generator

from modt_simulation import kinds, scenery
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.scenery import chair, pallets, shelf, table
from modt_simulation.sensors import SENSORS
from modt_simulation.simulator import Simulator
from modt_simulation.solids import Solids, box, cylinder
from modt_simulation.world import World
from modt_simulation.yard import enclose, floor
from modt_training.scan import Scan
from modt_training.simulated import labelled_scan
from tools.train import people_scans
from tools.train.mounts import MIN_RANGE_M, mounted

HEIGHT_M = (0.2, 1.0)
"""Least and greatest height of the sensor's mount."""
RANGE_M = (0.5, 6.0)
"""Least and greatest distance of people and things around it."""
SLOTS = 14
"""Directions in which something may stand."""
PERSON_SHARE = 0.32
"""Share of the directions in which a person stands."""
CAR_SHARE = 0.05
"""Share of the directions in which a car stands."""
EMPTY_SHARE = 0.15
"""Share of the directions in which nothing stands."""
POSED_SHARE = 0.6
"""Share of the people who are in any posture, with any load or aid."""
LIKE_PEOPLE_SHARE = 0.4
"""Share of the things that are taken for people in postures."""
ROWS_SHARE = 0.15
"""Share of the scenes with rows of vines or young trees on both sides of the robot."""
ROBOT_M = (0.4, 0.4)
"""Length and width of the robot, which nothing overlaps."""


def near_scene(rng: Generator, height_m: float) -> World:
    """A robot at rest among people, furniture, bins, posts, trees and cars."""
    builder = SceneBuilder(rng, 4.0)
    if rng.random() < ROWS_SHARE:
        people_scans.rows(builder)
    for k in range(SLOTS):
        draw = rng.random()
        bearing = 2 * np.pi * (k + rng.uniform(-0.25, 0.25)) / SLOTS
        distance = float(np.exp(rng.uniform(*np.log(RANGE_M))))
        x, y = distance * np.cos(bearing), distance * np.sin(bearing)
        turn = float(rng.uniform(-np.pi, np.pi))
        if draw < PERSON_SHARE:
            _person(builder, x, y, turn)
        elif draw < PERSON_SHARE + CAR_SHARE:
            out = 1.0 + 2.5 / distance
            builder.vehicle(kinds.CAR if rng.random() < 0.7 else kinds.VAN, Path.standing(out * x, out * y, turn))
        elif draw < 1.0 - EMPTY_SHARE:
            things = people_scans.THINGS if rng.random() < LIKE_PEOPLE_SHARE else THINGS
            thing = things[rng.choice(len(things))](rng)
            out = 1.0 + 0.5 * rng.random() / distance
            builder.scenery(thing, out * x, out * y, turn)
    half = tuple(rng.uniform(4.0, 12.0, 2).tolist())
    enclose(builder, half, rng.uniform(1.0, 4.0))
    ground = floor(rng, half, Material.FLOOR, 0.004)
    return builder.world(ground, Path.standing(0.0, 0.0, 0.0), height_m, sway_rad=0.004, ego_m=ROBOT_M)


def _person(builder: SceneBuilder, x: float, y: float, turn: float) -> None:
    """Add a person who stands, walks or, rarely, sits, or who is in any posture."""
    if builder.rng.random() < POSED_SHARE:
        people_scans.person(builder, x, y, turn, people_scans.WAYS)
        return
    draw = builder.rng.random()
    if draw < 0.5:
        builder.pedestrian(Path.standing(x, y, turn))
    elif draw < 0.95:
        speed = float(builder.rng.uniform(0.3, 1.6))
        end = x + speed * np.cos(turn), y + speed * np.sin(turn)
        builder.pedestrian(Path.steady(np.array([(x, y), end]), 0.0, speed, 1.0), speed)
    else:
        builder.sitter(Path.standing(x, y, turn))


def _post(rng: Generator) -> Solids:
    """A post, a pillar or a pipe."""
    radius = rng.uniform(0.02, 0.2)
    tall = rng.uniform(0.5, 3.0)
    return cylinder((0.0, 0.0, tall / 2), radius, tall, Material.METAL)


def _posts(rng: Generator) -> Solids:
    """Two to four posts or legs beside one another, at any distance."""
    radius = rng.uniform(0.015, 0.12)
    tall = rng.uniform(0.4, 2.5)
    gap = rng.uniform(0.12, 0.9)
    places = [(0.0, 0.0), (gap, 0.0), (0.0, gap), (gap, gap)][: int(rng.integers(2, 5))]
    return Solids.join([cylinder((x, y, tall / 2), radius, tall, Material.METAL) for x, y in places])


def _crate(rng: Generator) -> Solids:
    """A crate, a cupboard, a machine or a piece of wall."""
    long = rng.uniform(0.15, 1.6)
    deep = rng.uniform(0.1, 0.8)
    tall = rng.uniform(0.3, 2.2)
    return box((0.0, 0.0, tall / 2), (long, deep, tall), Material.WOOD)


def _bench(rng: Generator) -> Solids:
    """A slab on two broad feet."""
    long = rng.uniform(0.5, 1.6)
    tall = rng.uniform(0.35, 1.1)
    feet = [box((s * long / 3, 0.0, tall / 2), (0.12, 0.35, tall), Material.WOOD) for s in (-1, 1)]
    return Solids.join([*feet, box((0.0, 0.0, tall), (long, 0.4, 0.06), Material.WOOD)])


def _shrub(rng: Generator) -> Solids:
    return scenery.shrub(rng, rng.uniform(0.4, 1.6))


THINGS: tuple[Callable[[Generator], Solids], ...] = (
    table, chair, chair, shelf, pallets, scenery.bin_, scenery.tree, _shrub, _post, _post, _posts, _posts, _crate,
    _crate, _bench,
)  # fmt: skip


def near_scans(seeds: Sequence[int], sensors: Sequence[str] = tuple(SENSORS)) -> Iterator[Scan]:
    """A sweep of a world for each seed, by one sensor after another, each at a height of its own."""
    for seed, name in zip(seeds, cycle(sensors), strict=False):
        rng = np.random.default_rng([seed, 4])
        height_m = float(rng.uniform(*HEIGHT_M))
        model = replace(SENSORS[name], min_range_m=MIN_RANGE_M)
        frame, truth = Simulator(near_scene(rng, height_m), model, seed).sweep(int(rng.integers(0, 10)))
        scan = labelled_scan(frame, truth, f"near-{seed}", f"near-{seed}", camera=False, sensor=name)
        yield replace(scan, profile=mounted(name, height_m))
