"""People behind, on and below things: covers up to the waist, platforms, crowns of trees, awnings, doors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from modt.types import Float64
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.obstacles import REACH_M, level_world, uneven_ground, world_on
from modt_simulation.solids import Solids, block, box, cylinder, ellipsoid
from modt_simulation.world import World
from modt_simulation.yard import enclose

YARD_M = (18.0, 18.0)
"""Half the sides of the yard."""
PLATFORMS_M = (0.15, 0.3, 0.45, 0.6, 0.9)
"""Heights of platforms."""


class Cover(NamedTuple):
    """What hides people up to the waist."""

    depth_m: float
    width_m: float
    least_m: float  # height
    greatest_m: float
    material: Material
    density: float = np.inf  # of foliage [1/m]

    def solids(self, rng: Generator) -> Solids:
        """One of a random height."""
        size = self.depth_m, self.width_m, rng.uniform(self.least_m, self.greatest_m)
        return block(size, self.material, density=self.density)


COVERS = {
    "counter": Cover(0.6, 2.5, 0.9, 1.15, Material.WOOD),
    "crate": Cover(0.5, 1.0, 0.6, 1.1, Material.WOOD),
    "hedge": Cover(0.6, 4.0, 0.7, 1.0, Material.FOLIAGE, 6.0),
    "low wall": Cover(0.25, 4.0, 0.7, 1.1, Material.WALL),
}


def hidden(rng: Generator, seconds: float, height_m: float) -> World:
    """People who stand or walk behind what hides them up to the waist, in a walled yard."""
    builder = SceneBuilder(rng, seconds)
    first = rng.uniform(-np.pi, np.pi)
    for slot, (name, cover) in enumerate(COVERS.items()):
        bearing = first + slot * 2 * np.pi / len(COVERS)
        along = np.array([np.cos(bearing), np.sin(bearing)])
        across = np.array([-along[1], along[0]])
        distance = rng.uniform(2.5, 9.0)
        x, y = (distance * along).tolist()
        builder.scenery(cover.solids(rng), x, y, bearing)
        middle = (distance + cover.depth_m / 2 + rng.uniform(0.35, 1.2)) * along
        speed = rng.uniform(0.5, 1.4) * rng.integers(2)
        way = rng.choice((-0.5, 0.5)) * speed * seconds * across
        role = f"behind a {name}"
        if speed:
            builder.walker([middle - way, middle + way], speed, role=role)
        else:
            x, y = middle.tolist()
            builder.pedestrian(Path.standing(x, y, rng.uniform(-np.pi, np.pi)), role=role)
    enclose(builder, YARD_M, 3.0)
    return level_world(builder, Material.PAVING, height_m, 0.0)


def platform(rng: Generator, seconds: float, height_m: float) -> World:
    """People who stand and walk on a platform along the way, which is as high as a pavement, a stage or a dock."""
    builder = SceneBuilder(rng, seconds)
    platform_m = float(rng.choice(PLATFORMS_M))
    edge = rng.uniform(2.0, 4.0)
    builder.scenery(block((50.0, 0.3, 3.0 + platform_m), Material.WALL), 0.0, edge + rng.uniform(4.5, 8.5))
    for x in np.arange(-12.0, 13.0, 3.0) + rng.uniform(-1.0, 1.0, 9):
        y = edge + rng.uniform(0.4, 3.5)
        role = f"on a platform of {platform_m:g} m"
        if rng.random() < 0.5:
            builder.pedestrian(Path.standing(x, y, rng.uniform(-np.pi, np.pi)), role=role)
        else:
            builder.walker([(x, y), (x + rng.choice((-REACH_M, REACH_M)), y)], rng.uniform(0.6, 1.4), role=role)

    def height(x: Float64, y: Float64) -> Float64:
        level: Float64 = np.where(y > edge, platform_m, 0.0) + np.zeros_like(x)
        return level

    return world_on(builder, uneven_ground(rng, height, 0.1, 0.006, Material.PAVING), height_m)


def overhangs(rng: Generator, seconds: float, height_m: float) -> World:
    """People who stand below crowns, awnings and parasols, and in doors, in a walled yard."""
    builder = SceneBuilder(rng, seconds)
    first = rng.uniform(-np.pi, np.pi)
    parts = hanging(rng)
    for slot, (name, solids) in enumerate(parts.items()):
        bearing = first + slot * 2 * np.pi / len(parts)
        distance = rng.uniform(2.5, 9.0)
        x = distance * np.cos(bearing)
        y = distance * np.sin(bearing)
        builder.scenery(solids, x, y, bearing, overhead=True)
        builder.pedestrian(Path.standing(x, y, rng.uniform(-np.pi, np.pi)), role=f"below the {name}")
    enclose(builder, YARD_M, 3.0)
    return level_world(builder, Material.PAVING, height_m, 0.0)


def hanging(rng: Generator) -> dict[str, Solids]:
    """What hangs above the origin, and what holds it, by its name; a wall or a door lies across the x axis."""
    bottom = rng.uniform(1.95, 2.3)
    wide = rng.uniform(1.0, 2.0)
    wall_m = (0.2, 2.0, 2.6)
    parts = {
        "crown": (
            ellipsoid((0.0, 0.0, bottom + 0.7), (wide, wide, 0.7), Material.FOLIAGE, density=3.0),
            cylinder((0.75 * wide, 0.5 * wide, 1.3), 0.08, 2.6, Material.BARK),
        ),
        "parasol": (
            cylinder((0.0, 0.0, bottom), wide, 0.08, Material.CLOTH),
            cylinder((0.6, 0.3, bottom / 2), 0.025, bottom, Material.METAL),
        ),
        "awning": (
            box((0.4, 0.0, bottom), (1.6, 3.0, 0.06), Material.CLOTH),
            box((1.2, 0.0, 1.3), (0.1, 3.0, 2.6), Material.WALL),
        ),
        "door frame": (
            *(cylinder((0.0, side, 1.05), 0.05, 2.1, Material.METAL) for side in (-0.5, 0.5)),
            box((0.0, 0.0, 2.13), (0.1, 1.1, 0.08), Material.METAL),
        ),
        "lintel": (
            *(box((0.0, side, 1.3), wall_m, Material.WALL) for side in (-1.55, 1.55)),
            box((0.0, 0.0, 2.35), (0.2, 1.1, 0.5), Material.WALL),
        ),
    }
    return {name: Solids.join(solids) for name, solids in parts.items()}
