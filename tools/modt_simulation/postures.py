"""People in many postures, with what they carry and sit on, on rings around a robot at rest."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt_simulation import belongings, scenery
from modt_simulation.builder import LOW_M, SceneBuilder, clipped_normal
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.people import Posture
from modt_simulation.solids import Solids
from modt_simulation.world import World
from modt_simulation.yard import enclose, floor

RINGS_M = (1.0, 1.5, 2.5, 4.0, 7.0, 12.0)
NEAR_M = 0.7
"""Distance of who is at arm's length."""
SLOTS = (0, 2, 3, 4, 5, 6, 7)
"""Ninths of the turn with a person. Beside the first, who is near and looks wide, there is nobody."""
ROBOT_M = (0.3, 0.3)
"""Length and width of the robot, which has people at arm's length."""
HALF_M = (18.0, 18.0)
"""Half the sides of the ground."""
CARRYING = {"hands_x": 0.3, "hands_z": 0.2}
"""Joints of who carries a box."""


def people(rng: Generator) -> dict[str, tuple[Posture, float, float, Solids]]:
    """Posture, standing height, breadth with all things [m], and the things, by the role."""
    tall = clipped_normal(rng, 1.74, 0.08, 1.5, 1.95)
    none = Solids.none()
    return {
        "stands": (Posture.STAND, tall, 0.6, none),
        "stands on crutches": (Posture.STAND, tall, 0.75, belongings.crutches(rng, tall)),
        "stands with an umbrella": (Posture.STAND, tall, 1.1, belongings.umbrella(rng, tall)),
        "carries a box": (Posture.STAND, tall, 0.9, belongings.carried_box(rng, 0.4, 0.5 * tall + 0.2)),
        "child of 1.15 m": (Posture.STAND, 1.15, 0.5, none),
        "child of 0.85 m": (Posture.STAND, 0.85, 0.5, none),
        "sits on a chair": (Posture.SIT, tall, 0.8, scenery.chair(rng)),
        "sits in a wheelchair": (Posture.SIT, tall, 1.05, belongings.wheelchair(rng)),
        "sits on the floor": (Posture.FLOOR, tall, 0.0, none),
        "kneels": (Posture.KNEEL, tall, 0.0, none),
        "crouches": (Posture.CROUCH, tall, 0.0, none),
        "lies": (Posture.LIE, tall, 0.0, none),
    }


def postures(rng: Generator, seconds: float, height_m: float) -> World:
    """A person on each ring and one at arm's length, who look anywhere, in a walled yard.

    Who would overlap the robot or another person is left out, such as most of those who lie at arm's length.
    """
    builder = SceneBuilder(rng, seconds)
    first = rng.uniform(-np.pi, np.pi)
    roles = rng.permutation(list(people(rng))).tolist()
    for slot, role, distance_m in zip(SLOTS, roles, (NEAR_M, *rng.permutation(RINGS_M)), strict=False):
        posture, height, wide, things = people(rng)[role]
        bearing = first + slot * 2 * np.pi / 9
        x = distance_m * np.cos(bearing)
        y = distance_m * np.sin(bearing)
        place = Path.standing(x, y, rng.uniform(-np.pi, np.pi))
        size = LOW_M.get(posture, (wide, wide, height))
        joints = CARRYING if role == "carries a box" else {}
        builder.posed(posture, place, size, height, things, joints, role if slot else "at arm's length")
    enclose(builder, HALF_M, 3.0)
    ground = floor(rng, HALF_M, Material.PAVING, 0.006)
    return builder.world(ground, Path.standing(0.0, 0.0, 0.0), height_m, ego_m=ROBOT_M, margin_m=0.0)
