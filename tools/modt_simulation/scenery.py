"""Scenery: buildings, fences, poles, signs and plants of a road; furniture, doors, glass and racks indoors."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt_simulation.materials import Material
from modt_simulation.solids import Solids, block, box, cylinder, ellipsoid, rod


def building(rng: Generator, length: float, depth: float, height: float) -> Solids:
    """A house with recessed windows, bays, doors and steps; its front faces -y."""
    front = -depth / 2
    parts = [block((length, depth - 0.3, height), Material.WALL, y=0.15)]
    x = -length / 2
    while x < length / 2 - 0.5:  # wall between recessed windows
        end = min(x + rng.uniform(0.6, 1.6), length / 2)
        parts.append(block((end - x, 0.3, height), Material.WALL, (x + end) / 2, front + 0.15))
        x = end + rng.uniform(0.9, 1.8)
    for z0, z1 in ((0.0, 0.8), (2.2, 3.6), (5.0, 6.4)):
        if z1 < height:
            parts.append(box((0.0, front + 0.16, (z0 + z1) / 2), (length, 0.3, z1 - z0), Material.WALL))
    for _ in range(rng.integers(0, 3)):
        x = rng.uniform(-0.4, 0.4) * length
        bay = (rng.uniform(0.8, 2.4), rng.uniform(0.4, 1.4), rng.uniform(0.3, 2.8))
        parts.append(block(bay, Material.WALL, x, front - bay[1] / 2))
    return Solids.join(parts)


def fence(rng: Generator, length: float) -> Solids:
    """A fence of posts and semi-transparent panels along x."""
    height = rng.uniform(0.9, 1.7)
    posts = np.arange(-length / 2, length / 2 + 0.1, rng.uniform(1.8, 2.5))
    density = rng.choice([8.0, 25.0, 200.0])
    panel = box((0.0, 0.0, height / 2), (length, 0.05, height * 0.9), Material.WOOD, density=density)
    return Solids.join([panel, *(block((0.1, 0.1, height), Material.WOOD, x) for x in posts)])


def wall(rng: Generator, length: float) -> Solids:
    """A garden wall with gate posts along x."""
    height = rng.uniform(0.5, 1.6)
    posts = [box((s * length / 2, 0.0, height * 0.6), (0.4, 0.4, height * 1.2), Material.WALL) for s in (-1, 1)]
    return Solids.join([block((length, 0.25, height), Material.WALL), *posts])


def hedge(rng: Generator, length: float) -> Solids:
    """A hedge along x: a box of foliage with bulges."""
    height = rng.uniform(0.8, 1.9)
    depth = rng.uniform(0.5, 0.9)
    parts = [block((length, depth, height), Material.FOLIAGE, density=5.0)]
    for x in np.arange(-length / 2, length / 2, 1.5):
        semi = (0.9, 0.5 * depth + rng.uniform(0.0, 0.25), 0.5 * height + rng.uniform(0.0, 0.2))
        parts.append(ellipsoid((x, 0.0, height / 2), semi, Material.FOLIAGE, 4.0))
    return Solids.join(parts)


def shrub(rng: Generator, size: float) -> Solids:
    """A bush of a few ellipsoids of foliage."""
    parts = []
    for _ in range(rng.integers(2, 5)):
        r = size * rng.uniform(0.3, 0.55)
        x, y = rng.normal(0.0, 0.35 * size, 2)
        semi = (r, r * rng.uniform(0.7, 1.2), r * rng.uniform(0.8, 1.4))
        parts.append(ellipsoid((x, y, r * 0.9), semi, Material.FOLIAGE, 4.5))
    return Solids.join(parts)


def thicket(rng: Generator) -> Solids:
    """Bushes over the area of one or a few cars."""
    length = rng.uniform(2.0, 7.0)
    tall = rng.uniform(0.9, 3.0)
    parts = []
    for _ in range(rng.integers(4, 10)):
        r = rng.uniform(0.35, 1.0)
        centre = (rng.uniform(-0.5, 0.5) * length, rng.normal(0.0, 0.5), rng.uniform(0.2, 0.9) * tall)
        semi = (r, r * rng.uniform(0.6, 1.2), r * rng.uniform(0.5, 1.2))
        parts.append(ellipsoid(centre, semi, Material.FOLIAGE, rng.uniform(0.8, 4.0)))
    return Solids.join(parts)


def tree(rng: Generator) -> Solids:
    """A tree: a trunk, a canopy of ellipsoids, for some a bush at its foot."""
    radius = rng.uniform(0.08, 0.28)
    bare = rng.uniform(0.7, 1.7) if rng.random() < 0.4 else rng.uniform(1.7, 3.2)
    parts = [cylinder((0.0, 0.0, bare / 2 + 0.5), radius, bare + 1.0, Material.BARK)]
    spread = rng.uniform(1.2, 2.8)
    tall = rng.uniform(2.0, 4.5)
    for _ in range(rng.integers(4, 10)):
        x, y = rng.normal(0.0, 0.5 * spread, 2)
        z = bare + rng.uniform(0.1, 1.0) * tall
        r = spread * rng.uniform(0.2, 0.65)
        parts.append(ellipsoid((x, y, z), (r, r, 0.8 * r), Material.FOLIAGE, rng.uniform(0.6, 2.0)))
    if rng.random() < 0.4:
        parts.append(ellipsoid((0.0, 0.0, 0.3), (0.5, 0.5, 0.5), Material.FOLIAGE, 4.0))
    return Solids.join(parts)


def pole(rng: Generator) -> Solids:
    """A lamp post or a mast."""
    tall = rng.uniform(4.0, 8.0)
    parts = [cylinder((0.0, 0.0, tall / 2), rng.uniform(0.05, 0.13), tall, Material.METAL)]
    if rng.random() < 0.5:
        parts.append(block((0.35, 0.25, 1.0), Material.METAL))
    return Solids.join(parts)


def sign(rng: Generator) -> Solids:
    """A traffic sign on its post."""
    tall = rng.uniform(1.9, 2.8)
    wide = rng.uniform(0.5, 0.8)
    post = cylinder((0.0, 0.0, tall / 2), 0.04, tall, Material.METAL)
    return Solids.join([post, box((-0.05, 0.0, tall - wide / 2), (0.03, wide, wide), Material.SIGN)])


def bin_(rng: Generator) -> Solids:
    """A waste bin, a switch box or a bollard."""
    size = (rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.7), rng.uniform(0.7, 1.4))
    if rng.random() < 0.4:
        return cylinder((0.0, 0.0, size[2] / 2), size[0] / 3, size[2], Material.METAL)
    return block(size, Material.METAL)


def plants(rng: Generator, length: float, depth: float, n: int) -> Solids:
    """Low plants scattered over a rectangle."""
    parts = []
    for _ in range(n):
        r = rng.uniform(0.12, 0.45)
        tall = rng.uniform(0.15, 0.6)
        x, y = rng.uniform(-0.5, 0.5, 2) * (length, depth)
        parts.append(ellipsoid((x, y, 0.3 * tall), (r, r, 0.7 * tall), Material.FOLIAGE, rng.uniform(3.0, 8.0)))
    return Solids.join(parts)


def pallets(rng: Generator) -> Solids:
    """A stack of pallets or crates."""
    parts = []
    z = 0.0
    for _ in range(rng.integers(1, 5)):
        height = rng.choice([0.15, 0.4, 0.7])
        x, y = rng.normal(0, 0.04, 2)
        parts.append(box((x, y, z + height / 2), (1.2, 0.8, height), Material.WOOD, rng.normal(0, 0.05)))
        z += height
    return Solids.join(parts)


def table(rng: Generator) -> Solids:
    """A table on four legs."""
    long = rng.uniform(1.0, 2.0)
    deep = rng.uniform(0.6, 0.9)
    tall = rng.uniform(0.7, 0.78)
    legs = [(i * (long / 2 - 0.05), j * (deep / 2 - 0.05)) for i in (-1, 1) for j in (-1, 1)]
    top = box((0, 0, tall), (long, deep, 0.04), Material.WOOD)
    return Solids.join([top, *(cylinder((x, y, tall / 2), 0.03, tall, Material.METAL) for x, y in legs)])


def chair_legs(tall: float) -> list[Solids]:
    """The four legs of a chair or a stool."""
    return [
        rod((i * 0.2, j * 0.2, 0.0), (i * 0.18, j * 0.18, tall), 0.018, Material.METAL)
        for i in (-1, 1)
        for j in (-1, 1)
    ]


def chair(rng: Generator) -> Solids:
    """A chair."""
    back = box((-0.21, 0, 0.75), (0.04, 0.42, 0.35), Material.WOOD)
    return Solids.join([box((0, 0, 0.46), (0.45, 0.45, 0.05), Material.WOOD), back, *chair_legs(0.45)])


def shelf(rng: Generator) -> Solids:
    """Shelves with boxes on them."""
    long = rng.uniform(1.0, 2.5)
    tall = rng.uniform(1.4, 2.2)
    levels = np.arange(0.1, tall, 0.4)
    boards = [box((0, 0, z), (long, 0.4, 0.03), Material.METAL) for z in levels]
    sides = [block((0.04, 0.4, tall), Material.METAL, s * long / 2) for s in (-1, 1)]
    things = [
        box((rng.uniform(-0.4, 0.4) * long, 0, z + 0.13), (rng.uniform(0.1, 0.5), 0.3, 0.25), Material.WOOD)
        for z in levels
    ]
    return Solids.join([*boards, *sides, *things])


def door() -> Solids:
    """A closed door."""
    return block((0.9, 0.08, 2.1), Material.WOOD)


def pane(rng: Generator, height_m: float) -> Solids:
    """A pane of glass between two posts: most rays have no return from it."""
    long = rng.uniform(1.2, 2.0)
    glass = block((long, 0.03, height_m), Material.GLASS)
    posts = [block((0.06, 0.06, height_m), Material.METAL, s * long / 2) for s in (-1, 1)]
    return Solids.join([glass, *posts])


def rack(rng: Generator) -> Solids:
    """A rack of four levels with loads, 4 m long and 6 m high."""
    posts = [block((0.1, 0.1, 6.0), Material.METAL, i * 1.95, j * 0.5) for i in (-1, 1) for j in (-1, 1)]
    beams = [box((0, j * 0.5, z), (3.9, 0.06, 0.12), Material.METAL) for z in (1.6, 3.1, 4.6) for j in (-1, 1)]
    loads = [
        box((x, 0, z + tall / 2 + 0.1), (1.1, 0.9, tall), Material.WOOD)
        for z in (0.0, 1.7, 3.2, 4.7)
        for x, tall in zip((-1.25, 0.0, 1.25), rng.uniform(0.5, 1.2, 3).tolist(), strict=True)
        if rng.random() < 0.8
    ]
    return Solids.join([*posts, *beams, *loads])
