"""Things that people wear, carry, sit on and push, and things that are taken for people, of random proportions."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from modt_simulation.materials import Material
from modt_simulation.scenery import chair_legs
from modt_simulation.solids import Solids, block, box, cylinder, ellipsoid, rod

SIDES = (-1, 1)


def carried_box(rng: Generator, x: float, z: float) -> Solids:
    """A box, a sack or a board that hands at x, z hold."""
    size = (rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.8), rng.uniform(0.15, 0.6))
    middle = (x + size[0] / 4, 0.0, z + rng.uniform(0.0, 0.3))
    if rng.random() < 0.2:
        return ellipsoid(middle, (size[0] / 2, size[1] / 2, size[2] / 2), Material.CLOTH)
    return box(middle, size, Material.WOOD)


def umbrella(rng: Generator, height: float) -> Solids:
    """An open umbrella over a person of this height."""
    x, y = rng.uniform(-0.05, 0.25), rng.uniform(-0.2, 0.2)
    top = height + rng.uniform(0.1, 0.4)
    radius = rng.uniform(0.42, 0.65)
    stick = rod((x + 0.05, y, 0.55 * height), (x, y, top), 0.012, Material.METAL)
    return Solids.join([stick, ellipsoid((x, y, top), (radius, radius, rng.uniform(0.08, 0.2)), Material.CLOTH)])


def crutches(rng: Generator, height: float) -> Solids:
    """Two crutches, or a walking stick."""
    sides = SIDES if rng.random() < 0.7 else SIDES[:1]
    top = rng.uniform(0.48, 0.75) * height
    foot_x = rng.uniform(0.05, 0.4)
    return Solids.join([rod((foot_x, s * 0.36, 0.0), (0.05, s * 0.3, top), 0.015, Material.METAL) for s in sides])


def walking_frame(rng: Generator, height: float) -> Solids:
    """A walking frame or a rollator in front of its user."""
    near, far = rng.uniform(0.05, 0.2), rng.uniform(0.5, 0.7)
    top = 0.52 * height
    stays = [
        rod((x, s * 0.28, 0.0), (near + 0.1, s * 0.27, top), 0.015, Material.METAL)
        for x in (near, far)
        for s in SIDES
    ]
    bars = [rod((far - 0.2, -0.28, z * top), (far - 0.2, 0.28, z * top), 0.015, Material.METAL) for z in (0.5, 0.8)]
    basket = [box((far - 0.25, 0.0, 0.5), (0.25, 0.4, 0.25), Material.CLOTH)] if rng.random() < 0.5 else []
    return Solids.join([*stays, *bars, *basket])


def luggage(rng: Generator) -> Solids:
    """A suitcase or a bag beside or behind a person, or a bag at each side."""
    size = (rng.uniform(0.15, 0.35), rng.uniform(0.3, 0.5), rng.uniform(0.3, 0.75))
    if rng.random() < 0.4:
        z = rng.uniform(0.25, 0.5)
        return Solids.join([box((0.0, s * 0.36, z), (0.35, 0.15, 0.35), Material.CLOTH) for s in SIDES])
    x, y = rng.uniform(-0.6, 0.1), rng.choice(SIDES) * rng.uniform(0.35, 0.5)
    case = box((x, y, size[2] / 2 + 0.04), size, Material.CLOTH)
    return Solids.join([case, rod((x, y, size[2]), (0.05, 0.28 * np.sign(y), 0.78), 0.012, Material.METAL)])


def seat(rng: Generator, height: float) -> Solids:
    """Seat of a person: a chair, a stool, a block or a bench."""
    kind = rng.integers(4)
    tall = 0.44
    if kind == 0:
        return block((0.42, 0.42, tall), Material.WOOD, -0.02)
    if kind == 1:
        wide = rng.uniform(0.9, 2.0)
        feet = [box((-0.05, s * wide / 2.4, tall / 2), (0.4, 0.06, tall), Material.WOOD) for s in SIDES]
        return Solids.join([box((-0.05, 0.0, tall - 0.03), (0.45, wide, 0.06), Material.WOOD), *feet])
    parts = [box((0.0, 0.0, tall - 0.03), (0.45, 0.45, 0.06), Material.WOOD), *chair_legs(tall)]
    if kind == 2:
        parts.append(box((-0.23, 0.0, rng.uniform(0.65, 0.8)), (0.04, 0.42, rng.uniform(0.25, 0.6)), Material.WOOD))
    return Solids.join(parts)


def wheelchair(rng: Generator) -> Solids:
    """A wheelchair without its user."""
    radius = rng.uniform(0.26, 0.33)
    wide = rng.uniform(0.24, 0.32)
    parts = [box((-0.02, 0.0, 0.44), (0.45, 0.45, 0.06), Material.CLOTH)]
    parts.append(box((-0.25, 0.0, 0.7), (0.04, 0.42, rng.uniform(0.35, 0.6)), Material.CLOTH))
    for s in SIDES:
        parts.append(cylinder((-0.1, s * wide, radius), radius, 0.03, Material.RUBBER, axis=1))
        parts.append(cylinder((rng.uniform(0.28, 0.4), s * 0.22, 0.08), 0.08, 0.03, Material.RUBBER, axis=1))
        parts.append(rod((0.12, s * 0.25, 0.68), (-0.25, s * 0.25, 0.68), 0.02, Material.METAL))
        if rng.random() < 0.7:
            parts.append(rod((-0.25, s * 0.22, 0.9), (-0.42, s * 0.22, 0.92), 0.02, Material.METAL))
        parts.append(rod((0.2, s * 0.18, 0.44), (0.42, s * 0.15, 0.1), 0.02, Material.METAL))
    return Solids.join(parts)


def sack(rng: Generator) -> Solids:
    """One to three sacks or bags, on one another."""
    parts = []
    for k in range(rng.integers(1, 4)):
        semi = tuple(rng.uniform((0.15, 0.15, 0.1), (0.45, 0.35, 0.3)).tolist())
        x, y = rng.normal(0.0, 0.1, 2)
        parts.append(ellipsoid((float(x), float(y), semi[2] * (1 + 1.5 * k)), semi, Material.CLOTH))
    return Solids.join(parts)


def stake(rng: Generator) -> Solids:
    """A vine or a young plant at a stake, with some leaves."""
    tall = rng.uniform(0.7, 2.0)
    parts = [cylinder((0.0, 0.0, tall / 2), rng.uniform(0.015, 0.06), tall, Material.BARK)]
    for _ in range(rng.integers(1, 7)):
        x, y = rng.normal(0.0, 0.12, 2)
        r = rng.uniform(0.08, 0.35)
        z = rng.uniform(0.2, 1.05) * tall
        semi = (r, r * rng.uniform(0.7, 1.2), r * rng.uniform(0.6, 1.8))
        parts.append(ellipsoid((float(x), float(y), max(z, 0.15)), semi, Material.FOLIAGE, rng.uniform(1.0, 9.0)))
    return Solids.join(parts)


def bust(rng: Generator) -> Solids:
    """A monument: a plinth with a ball, a vase or a head on it."""
    base = rng.uniform(0.3, 0.8)
    tall = rng.uniform(0.5, 1.3)
    r = rng.uniform(0.12, 0.3)
    return Solids.join(
        [block((base, base, tall), Material.WALL), ellipsoid((0.0, 0.0, tall + r), (r, r, 1.3 * r), Material.WALL)]
    )


def board(rng: Generator) -> Solids:
    """A stand-up sign, a notice board or a panel on two feet."""
    wide, tall = rng.uniform(0.4, 1.2), rng.uniform(0.6, 1.9)
    low = rng.uniform(0.0, 0.5) * tall
    panel = box((0.0, 0.0, (low + tall) / 2), (0.05, wide, tall - low), Material.SIGN)
    return Solids.join([panel, *(block((0.05, 0.05, tall), Material.METAL, 0.0, s * wide / 2) for s in SIDES)])


def cone(rng: Generator) -> Solids:
    """A traffic cone, a barrel, a churn or a hydrant."""
    tall, radius = rng.uniform(0.4, 1.1), rng.uniform(0.1, 0.32)
    top = rng.uniform(0.2, 1.0)
    rings = [
        cylinder((0.0, 0.0, (k + 0.5) * tall / 4), radius * (1 + k * (top - 1) / 4), tall / 4, Material.METAL)
        for k in range(4)
    ]
    return Solids.join(rings)


def topped(rng: Generator) -> Solids:
    """Thing that is wide at the top only: a letter box, a small sign, a lamp, or a clipped bush on its trunk."""
    foot = rng.uniform(0.2, 0.7) if rng.random() < 0.6 else rng.uniform(0.7, 1.6)
    radius = rng.uniform(0.02, 0.1) if foot < 0.7 else 0.02
    semi = tuple((rng.uniform((0.15, 0.15, 0.25), (0.45, 0.4, 0.8)) / (1.0, 1.0, 2.0)).tolist())
    middle = (0.0, 0.0, foot + semi[2])
    post = cylinder((0.0, 0.0, foot / 2), radius, foot, Material.METAL)
    if rng.random() < 0.5:
        return Solids.join([post, box(middle, (2 * semi[0], 2 * semi[1], 2 * semi[2]), Material.METAL)])
    return Solids.join([post, ellipsoid(middle, semi, Material.FOLIAGE, rng.uniform(3.0, 30.0))])


def stone(rng: Generator) -> Solids:
    """A stump, a stone, a plant pot, a grave stone or the end of a low wall."""
    wide, deep = rng.uniform(0.2, 0.8, 2)
    tall = rng.uniform(0.25, 1.2)
    material = (Material.WALL, Material.BARK, Material.METAL)[rng.integers(3)]
    kind = rng.integers(4)
    if kind == 0:
        return cylinder((0.0, 0.0, tall / 2), wide / 2, tall, material)
    if kind == 1:
        return ellipsoid((0.0, 0.0, 0.3 * tall), (wide / 2, deep / 2, 0.7 * tall), material)
    if kind == 2:
        pot = cylinder((0.0, 0.0, tall / 4), wide / 2, tall / 2, material)
        semi = (0.5 * wide + 0.1, 0.5 * wide + 0.1, 0.4 * tall)
        return Solids.join([pot, ellipsoid((0.0, 0.0, 0.8 * tall), semi, Material.FOLIAGE, rng.uniform(2.0, 12.0))])
    return block((wide, deep, tall), material)


def statue(rng: Generator) -> Solids:
    """A low figure of stone without limbs: a trunk that leans, and a head or none."""
    tall = rng.uniform(0.5, 1.3)
    wide = rng.uniform(0.15, 0.3)
    lean = rng.uniform(-0.2, 0.2)
    parts = [ellipsoid((lean / 2, 0.0, 0.4 * tall), (0.8 * wide, wide, 0.45 * tall), Material.WALL)]
    if rng.random() < 0.5:
        radius = rng.uniform(0.25, 0.6) * wide
        parts.append(ellipsoid((lean, 0.0, 0.9 * tall), (radius, radius, radius), Material.WALL))
    return Solids.join(parts)


def suitcase(rng: Generator) -> Solids:
    """Luggage or boxes that nobody is near: one or two, on one another or side by side."""
    parts = []
    top = 0.03
    for _ in range(rng.integers(1, 4)):
        size = tuple(rng.uniform((0.2, 0.3, 0.25), (0.5, 0.7, 0.8)).tolist())
        x, y = rng.normal(0.0, 0.08, 2)
        parts.append(box((float(x), float(y), top + size[2] / 2), size, Material.CLOTH, rng.uniform(-0.3, 0.3)))
        top = top + size[2] if rng.random() < 0.5 else 0.03
    return Solids.join(parts)
