"""Simulated sweeps of people in all postures, with what they carry and push, and of what is taken for them.

Streets show people who stand and walk. A network that has seen no others takes who sits, crouches or lies for
background.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.random import Generator

from modt_simulation import belongings, kinds, movers, scenery
from modt_simulation.builder import LOW_M, SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.people import Posture
from modt_simulation.scenery import chair, pallets, shelf, table
from modt_simulation.solids import Solids, block
from modt_simulation.world import Body, World
from modt_simulation.yard import enclose, floor
from tools.train import bare_scans
from tools.train.mounts import mounted
from tools.train.worlds import Worlds

RANGE_M = (0.8, 18.0)
"""Least and greatest distance of people and things."""
SLOTS = 26
"""Number of directions in which somebody or something may be."""
PERSON_SHARE = 0.5
"""Share of the directions with a person."""
FREE_SHARE = 0.1
"""Share of the directions with nothing."""
PAIR_SHARE = 0.12
"""Share of the people who have another one close to them."""
BACKED_SHARE = 0.15
"""Share of the people right before a wall, a counter or a machine."""
ROWS_SHARE = 0.3
"""Share of the scenes with rows of vines or young trees on both sides of the robot."""
ROBOT_M = (0.4, 0.4)
"""Length and width of the robot, which nothing overlaps."""
JOINTS = {"lean": 0.15, "hips_x": 0.04, "hips_z": 0.03, "hands_x": 0.12, "hands_z": 0.1, "feet_x": 0.08}
"""Standard deviations of the joints around those of a posture."""
TOUCHING_M = 0.0
"""Margin around bodies, which may touch."""


def people_scene(rng: Generator, height_m: float, ways: Sequence[Way]) -> World:
    """A robot at rest among people, met in these ways, and things of their size, in the open or between walls."""
    builder = SceneBuilder(rng, 4.0)
    if rng.random() < ROWS_SHARE:
        rows(builder)
    for k in range(SLOTS):
        draw = rng.random()
        bearing = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / SLOTS
        distance = float(np.exp(rng.uniform(*np.log(RANGE_M))))
        x, y = distance * np.cos(bearing), distance * np.sin(bearing)
        turn = float(rng.uniform(-np.pi, np.pi))
        if draw < PERSON_SHARE:
            person(builder, x, y, turn, ways)
            if rng.random() < PAIR_SHARE:
                apart = rng.uniform(0.55, 0.9)
                across = bearing + np.pi / 2
                _upright(builder, x + apart * np.cos(across), y + apart * np.sin(across), turn)
            if rng.random() < BACKED_SHARE:
                _backing(builder, distance, bearing)
        elif draw < 1.0 - FREE_SHARE:
            builder.scenery(THINGS[rng.choice(len(THINGS))](rng), x, y, turn)
    half = tuple(rng.uniform(6.0, 22.0, 2).tolist())
    if rng.random() < 0.7:
        enclose(builder, half, rng.uniform(1.0, 4.0))
    material = (Material.FLOOR, Material.ASPHALT, Material.PAVING, Material.GRASS)[rng.integers(4)]
    ground = floor(rng, (22.0, 22.0), material, rng.uniform(0.002, 0.025))
    ego = Path.standing(0.0, 0.0, 0.0)
    return builder.world(ground, ego, height_m, sway_rad=0.004, ego_m=ROBOT_M, margin_m=TOUCHING_M)


def _backing(builder: SceneBuilder, distance_m: float, bearing: float) -> None:
    """Add a wall, a counter or a machine behind a person, seen from the robot."""
    rng = builder.rng
    away = distance_m + rng.uniform(0.45, 0.9)
    size = (rng.uniform(0.2, 0.8), rng.uniform(0.8, 3.0), rng.uniform(0.8, 2.5))
    builder.scenery(block(size, Material.WALL), away * np.cos(bearing), away * np.sin(bearing), bearing)


def rows(builder: SceneBuilder) -> None:
    """Add rows of vines or young trees along the way of the robot."""
    rng = builder.rng
    plant = (belongings.stake, bare_scans.sapling)[rng.integers(2)]
    gap = rng.uniform(1.8, 4.5)
    step = rng.uniform(0.8, 2.5)
    for row in (-1.5, -0.5, 0.5, 1.5):
        for along in np.arange(-14.0, 14.0, step) + rng.uniform(0.0, step):
            builder.scenery(plant(rng), along + rng.normal(0.0, 0.1), row * gap + rng.normal(0.0, 0.06))


def _joints(rng: Generator) -> dict[str, float]:
    """Random differences of the joints from those of the posture."""
    joints = {name: float(rng.normal(0.0, sigma)) for name, sigma in JOINTS.items()}
    return joints | {"feet_apart": float(abs(rng.normal(0.0, 0.05)))}


def _height(rng: Generator) -> float:
    """Standing height of a person [m]: of one in three that of a child."""
    return float(rng.uniform(0.75, 1.45) if rng.random() < 0.35 else np.clip(rng.normal(1.72, 0.09), 1.45, 2.0))


@dataclass(frozen=True)
class Place:
    """Place and kind of a person.

    Attributes:
        x, y: place [m].
        turn: heading [rad].
        height: standing height [m].
        joints: differences of the joints from those of the posture.
    """

    x: float
    y: float
    turn: float
    height: float
    joints: dict[str, float]

    @property
    def standing(self) -> Path:
        """The path of who stays."""
        return Path.standing(self.x, self.y, self.turn)


def _upright(builder: SceneBuilder, x: float, y: float, turn: float) -> None:
    """Add a person who stands or walks."""
    rng = builder.rng
    height = _height(rng)
    speed = 0.0 if rng.random() < 0.5 else float(rng.uniform(0.3, 1.6))
    path = Path.standing(x, y, turn)
    if speed:
        path = Path.steady(np.array([(x, y), (x + 4 * np.cos(turn), y + 4 * np.sin(turn))]), 0.0, speed, 1.0)
    builder.pedestrian(path, speed, height)


def person(builder: SceneBuilder, x: float, y: float, turn: float, ways: Sequence[Way]) -> None:
    """Add a person in any posture, with any belongings, met in one of some ways."""
    rng = builder.rng
    way = ways[rng.choice(len(ways))]
    way(builder, Place(x, y, turn, _height(rng), _joints(rng)))


def _stand(builder: SceneBuilder, place: Place) -> None:
    _upright(builder, place.x, place.y, place.turn)


def _bend(builder: SceneBuilder, place: Place) -> None:
    rng = builder.rng
    lean = rng.uniform(0.4, 1.4)
    hands = {"hands_x": rng.uniform(0.2, 0.5), "hands_z": rng.uniform(-0.6, 0.1)}
    size = (0.9, 0.6, place.height)
    joints = place.joints | {"lean": lean} | hands
    builder.posed(Posture.STAND, place.standing, size, place.height, Solids.none(), joints)


def _carry(builder: SceneBuilder, place: Place) -> None:
    rng = builder.rng
    hands = {"hands_x": rng.uniform(0.15, 0.4), "hands_z": rng.uniform(-0.1, 0.3) * place.height / 1.7}
    held = belongings.carried_box(rng, 0.08 + hands["hands_x"], 0.5 * place.height + hands["hands_z"])
    size = (0.9, 0.7, place.height)
    builder.posed(Posture.STAND, place.standing, size, place.height, held, place.joints | hands)


def _with(belonging: Callable[[Generator, float], Solids], width_m: float) -> Way:
    """People who stand with something, within a square of this width."""

    def add(builder: SceneBuilder, place: Place) -> None:
        size = (width_m, width_m, place.height)
        held = belonging(builder.rng, place.height)
        builder.posed(Posture.STAND, place.standing, size, place.height, held, place.joints)

    return add


def _sit(builder: SceneBuilder, place: Place) -> None:
    _seated(builder, place, (0.8, 0.6, 1.32), belongings.seat(builder.rng, place.height))


def _wheelchair(builder: SceneBuilder, place: Place) -> None:
    _seated(builder, place, (1.05, 0.68, 1.33), belongings.wheelchair(builder.rng))


def _seated(builder: SceneBuilder, place: Place, size: tuple[float, float, float], seat: Solids) -> None:
    joints = place.joints | {"hips_z": 0.0}
    builder.posed(Posture.SIT, place.standing, size, max(place.height, 1.1), seat, joints)


def _low(posture: Posture) -> Way:
    """People who crouch, kneel, or are on the floor; only adults kneel."""

    def add(builder: SceneBuilder, place: Place) -> None:
        height = max(place.height, 1.45) if posture == Posture.KNEEL else place.height
        builder.posed(posture, place.standing, LOW_M[posture], height, Solids.none(), place.joints)

    return add


def _lie(builder: SceneBuilder, place: Place) -> None:
    joints = place.joints | {"lean": place.joints["lean"] / 4, "hips_z": 0.0}
    builder.posed(Posture.LIE, place.standing, LOW_M[Posture.LIE], place.height, Solids.none(), joints)


def _push(builder: SceneBuilder, place: Place) -> None:
    """Add a person and what they push, a body of its own."""
    mover = (movers.pushchair, movers.trolley)[builder.rng.integers(2)](builder.rng)
    builder.bodies.append(Body(kinds.OTHER, mover.size, place.standing, mover.solids))
    behind_x = place.x - mover.pusher_m * np.cos(place.turn)
    behind_y = place.y - mover.pusher_m * np.sin(place.turn)
    builder.pedestrian(Path.standing(behind_x, behind_y, place.turn))


def _any_luggage(rng: Generator, height_m: float) -> Solids:
    return belongings.luggage(rng)


Way = Callable[[SceneBuilder, Place], None]
"""How a person is met."""
WAYS: tuple[Way, ...] = (
    *(_stand,) * 4, _bend, *(_carry,) * 3, *(_with(belongings.umbrella, 1.1),) * 3,
    *(_with(belongings.crutches, 0.75),) * 2, _with(belongings.walking_frame, 0.75), _with(_any_luggage, 0.75),
    *(_sit,) * 2, *(_wheelchair,) * 2, _push, *(_low(Posture.FLOOR),) * 2, *(_low(Posture.CROUCH),) * 2,
    _low(Posture.KNEEL), *(_lie,) * 2,
)  # fmt: skip
"""Ways in which people are met, some oftener than others."""
LOW_WAYS: tuple[Way, ...] = (
    *(_stand,) * 3, *(_carry,) * 3, *(_low(Posture.CROUCH),) * 4, *(_low(Posture.KNEEL),) * 3, *(_lie,) * 4,
    _low(Posture.FLOOR), _sit,
)  # fmt: skip
"""The same with more of the postures of which few beams show little."""


def _shrub(rng: Generator) -> Solids:
    return scenery.shrub(rng, rng.uniform(0.3, 1.6))


def _animal(rng: Generator) -> Solids:
    return (movers.dog, movers.robot)[rng.integers(2)](rng).solids


def _empty(rng: Generator) -> Solids:
    """A chair, a wheelchair, a pushchair, a walking frame or a trolley with nobody."""
    makers = (chair, belongings.wheelchair, lambda g: belongings.walking_frame(g, 1.7),
              lambda g: movers.pushchair(g).solids,
              lambda g: movers.trolley(g).solids, lambda g: belongings.seat(g, 1.7))  # fmt: skip
    return makers[rng.integers(len(makers))](rng)


def _heap(rng: Generator) -> Solids:
    """A heap, a boulder, a bush or a young tree."""
    return bare_scans.MAKERS[rng.choice(len(bare_scans.MAKERS))](rng)


THINGS: tuple[Callable[[Generator], Solids], ...] = (
    _shrub, _shrub, belongings.stake, belongings.stake, scenery.bin_, scenery.bin_, belongings.sack, belongings.sack,
    scenery.sign, belongings.board, belongings.bust, belongings.cone, _animal, _empty, _empty, _empty,
    belongings.topped, belongings.topped, belongings.stone, belongings.stone, belongings.statue, belongings.suitcase,
    _heap, _heap, _heap,
    table, shelf, pallets, scenery.tree, scenery.pole,
)  # fmt: skip


WORLDS = Worlds(
    name="people",
    stream=6,
    scene=partial(people_scene, ways=WAYS),
    height_m=(0.25, 2.2),
    usual_height_share=0.3,
    sweeps=10,
    profile=mounted,
)
people_scans = WORLDS.scans
low_people_scans = replace(WORLDS, scene=partial(people_scene, ways=LOW_WAYS)).scans
