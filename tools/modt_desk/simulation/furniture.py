"""Furniture, doors and glass."""

from __future__ import annotations

import numpy as np

from modt_desk.simulation.materials import Material
from modt_desk.simulation.solids import Solids, box, cylinder, rod


def pallets(rng: np.random.Generator) -> Solids:
    """A stack of pallets or crates."""
    layers, z = int(rng.integers(1, 5)), 0.0
    parts = []
    for _ in range(layers):
        height = float(rng.choice([0.15, 0.4, 0.7]))
        shift = rng.normal(0, 0.04, 2)
        size, turn = (1.2, 0.8, height), rng.normal(0, 0.05)
        parts.append(box((shift[0], shift[1], z + height / 2), size, Material.WOOD, turn))
        z += height
    return Solids.join(parts)


def table(rng: np.random.Generator) -> Solids:
    """A table on four legs."""
    long, deep, tall = rng.uniform(1.0, 2.0), rng.uniform(0.6, 0.9), rng.uniform(0.7, 0.78)
    legs = [(i * (long / 2 - 0.05), j * (deep / 2 - 0.05)) for i in (-1, 1) for j in (-1, 1)]
    top = box((0, 0, tall), (long, deep, 0.04), Material.WOOD)
    return Solids.join([top, *(cylinder((x, y, tall / 2), 0.03, tall, Material.METAL) for x, y in legs)])


def chair(rng: np.random.Generator) -> Solids:
    """A chair."""
    corners = [(i, j) for i in (-1, 1) for j in (-1, 1)]
    legs = [rod((i * 0.2, j * 0.2, 0.0), (i * 0.18, j * 0.18, 0.45), 0.018, Material.METAL) for i, j in corners]
    back = box((-0.21, 0, 0.75), (0.04, 0.42, 0.35), Material.WOOD)
    return Solids.join([box((0, 0, 0.46), (0.45, 0.45, 0.05), Material.WOOD), back, *legs])


def shelf(rng: np.random.Generator) -> Solids:
    """Shelves with boxes on them."""
    long, tall = rng.uniform(1.0, 2.5), rng.uniform(1.4, 2.2)
    boards = [box((0, 0, z), (long, 0.4, 0.03), Material.METAL) for z in np.arange(0.1, tall, 0.4)]
    sides = [box((s * long / 2, 0, tall / 2), (0.04, 0.4, tall), Material.METAL) for s in (-1, 1)]
    things = [
        box((rng.uniform(-0.4, 0.4) * long, 0, z + 0.13), (rng.uniform(0.1, 0.5), 0.3, 0.25), Material.WOOD)
        for z in np.arange(0.1, tall, 0.4)
    ]
    return Solids.join([*boards, *sides, *things])


def door() -> Solids:
    """A closed door."""
    return box((0, 0, 1.05), (0.9, 0.08, 2.1), Material.WOOD)


def pane(rng: np.random.Generator, height_m: float) -> Solids:
    """A pane of glass between two posts: most rays have no return from it."""
    long = float(rng.uniform(1.2, 2.0))
    glass = box((0, 0, height_m / 2), (long, 0.03, height_m), Material.GLASS)
    posts = [box((s * long / 2, 0, height_m / 2), (0.06, 0.06, height_m), Material.METAL) for s in (-1, 1)]
    return Solids.join([glass, *posts])
