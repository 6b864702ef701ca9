"""What stands beside a road: buildings, fences, poles, signs, trees, bushes."""

from __future__ import annotations

import numpy as np

from modt.simulation.materials import Material
from modt.simulation.solids import Pieces, box, bush, cylinder, ellipsoid


def building(rng: np.random.Generator, length: float, depth: float, height: float) -> Pieces:
    """A house: walls with recesses, bays, doors and steps; its front looks to -y."""
    front = -depth / 2
    parts = [box((0.0, 0.15, height / 2), (length, depth - 0.3, height), Material.WALL)]
    x = -length / 2
    while x < length / 2 - 0.5:  # bays of wall between recessed windows
        pier = rng.uniform(0.6, 1.6)
        end = min(x + pier, length / 2)
        parts.append(box(((x + end) / 2, front + 0.15, height / 2), (end - x, 0.3, height), Material.WALL))
        x = end + rng.uniform(0.9, 1.8)
    for z0, z1 in ((0.0, 0.8), (2.2, 3.6), (5.0, 6.4)):
        if z1 < height:
            parts.append(box((0.0, front + 0.16, (z0 + z1) / 2), (length, 0.3, z1 - z0), Material.WALL))
    for _ in range(int(rng.integers(0, 3))):
        at = rng.uniform(-0.4, 0.4) * length
        wide, deep, tall = rng.uniform(0.8, 2.4), rng.uniform(0.4, 1.4), rng.uniform(0.3, 2.8)
        parts.append(box((at, front - deep / 2, tall / 2), (wide, deep, tall), Material.WALL))
    return Pieces.join(parts)


def fence(rng: np.random.Generator, length: float) -> Pieces:
    """A fence of posts and rails along x."""
    height = rng.uniform(0.9, 1.7)
    posts = np.arange(-length / 2, length / 2 + 0.1, rng.uniform(1.8, 2.5))
    panel = box((0.0, 0.0, height / 2), (length, 0.05, height * 0.9), Material.WOOD)
    panel.density[:] = rng.choice([8.0, 25.0, 200.0])
    return Pieces.join([panel, *(box((x, 0.0, height / 2), (0.1, 0.1, height), Material.WOOD) for x in posts)])


def wall(rng: np.random.Generator, length: float) -> Pieces:
    """A garden wall along x, with gate posts."""
    height = rng.uniform(0.5, 1.6)
    return Pieces.join(
        [
            box((0.0, 0.0, height / 2), (length, 0.25, height), Material.WALL),
            *(box((s * length / 2, 0.0, height * 0.6), (0.4, 0.4, height * 1.2), Material.WALL) for s in (-1, 1)),
        ]
    )


def hedge(rng: np.random.Generator, length: float) -> Pieces:
    """A hedge along x: a box of leaves with lumps."""
    height, depth = rng.uniform(0.8, 1.9), rng.uniform(0.5, 0.9)
    parts = [bush((0.0, 0.0, height / 2), (length, depth, height), Material.FOLIAGE, 5.0)]
    for x in np.arange(-length / 2, length / 2, 1.5):
        lump = (0.9, 0.5 * depth + rng.uniform(0.0, 0.25), 0.5 * height + rng.uniform(0.0, 0.2))
        parts.append(ellipsoid((x, 0.0, height / 2), lump, Material.FOLIAGE, 4.0))
    return Pieces.join(parts)


def shrub(rng: np.random.Generator, size: float) -> Pieces:
    """A bush of a few lumps of leaves."""
    parts = []
    for _ in range(int(rng.integers(2, 5))):
        r = size * rng.uniform(0.3, 0.55)
        x, y = rng.normal(0.0, 0.35 * size, 2)
        parts.append(
            ellipsoid(
                (x, y, r * 0.9), (r, r * rng.uniform(0.7, 1.2), r * rng.uniform(0.8, 1.4)), Material.FOLIAGE, 4.5
            )
        )
    return Pieces.join(parts)


def thicket(rng: np.random.Generator) -> Pieces:
    """A tangle of bushes the size of a car, or a few of them."""
    length, tall = rng.uniform(2.0, 7.0), rng.uniform(0.9, 3.0)
    parts = []
    for _ in range(int(rng.integers(4, 10))):
        r = rng.uniform(0.35, 1.0)
        x, y = rng.uniform(-0.5, 0.5) * length, rng.normal(0.0, 0.5)
        z = rng.uniform(0.2, 0.9) * tall
        semi = (r, r * rng.uniform(0.6, 1.2), r * rng.uniform(0.5, 1.2))
        parts.append(ellipsoid((x, y, z), semi, Material.FOLIAGE, rng.uniform(0.8, 4.0)))
    return Pieces.join(parts)


def tree(rng: np.random.Generator) -> Pieces:
    """A tree: trunk, perhaps bushes at its foot, and a canopy of leafy lumps, some of which hang low."""
    radius = rng.uniform(0.08, 0.28)
    bare = rng.uniform(0.7, 1.7) if rng.random() < 0.4 else rng.uniform(1.7, 3.2)
    parts = [cylinder((0.0, 0.0, bare / 2 + 0.5), radius, bare + 1.0, Material.BARK)]
    spread, tall = rng.uniform(1.2, 2.8), rng.uniform(2.0, 4.5)
    for _ in range(int(rng.integers(4, 10))):
        x, y = rng.normal(0.0, 0.5 * spread, 2)
        z = bare + rng.uniform(0.1, 1.0) * tall
        r = spread * rng.uniform(0.2, 0.65)
        parts.append(ellipsoid((x, y, z), (r, r, 0.8 * r), Material.FOLIAGE, rng.uniform(0.6, 2.0)))
    if rng.random() < 0.4:
        parts.append(ellipsoid((0.0, 0.0, 0.3), (0.5, 0.5, 0.5), Material.FOLIAGE, 4.0))
    return Pieces.join(parts)


def pole(rng: np.random.Generator) -> Pieces:
    """A lamp post or a mast."""
    tall = rng.uniform(4.0, 8.0)
    parts = [cylinder((0.0, 0.0, tall / 2), rng.uniform(0.05, 0.13), tall, Material.METAL)]
    if rng.random() < 0.5:
        parts.append(box((0.0, 0.0, 0.5), (0.35, 0.25, 1.0), Material.METAL))
    return Pieces.join(parts)


def sign(rng: np.random.Generator) -> Pieces:
    """A traffic sign on its post."""
    tall = rng.uniform(1.9, 2.8)
    wide = rng.uniform(0.5, 0.8)
    return Pieces.join(
        [
            cylinder((0.0, 0.0, tall / 2), 0.04, tall, Material.METAL),
            box((-0.05, 0.0, tall - wide / 2), (0.03, wide, wide), Material.SIGN),
        ]
    )


def bin_(rng: np.random.Generator) -> Pieces:
    """A waste bin, a box of switches, a bollard: low street furniture."""
    size = (rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.7), rng.uniform(0.7, 1.4))
    if rng.random() < 0.4:
        return cylinder((0.0, 0.0, size[2] / 2), size[0] / 3, size[2], Material.METAL)
    return box((0.0, 0.0, size[2] / 2), size, Material.METAL)


def plants(rng: np.random.Generator, length: float, depth: float, n: int) -> Pieces:
    """Low plants, tufts and stones strewn over a patch of ground."""
    parts = []
    for _ in range(n):
        r = rng.uniform(0.12, 0.45)
        tall = rng.uniform(0.15, 0.6)
        x, y = rng.uniform(-0.5, 0.5, 2) * (length, depth)
        parts.append(ellipsoid((x, y, 0.3 * tall), (r, r, 0.7 * tall), Material.FOLIAGE, rng.uniform(3.0, 8.0)))
    return Pieces.join(parts)
