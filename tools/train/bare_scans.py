"""Simulated sweeps without a single object: heaps, banks, boulders, rubble, stacks, bushes and young trees.

Streets have none of these, and a network that has never seen a heap takes it for a car.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from scipy import ndimage

from modt import profile
from modt.config import ProfileConfig
from modt.types import Float64
from modt_simulation import scenery
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.solids import Solids, Triple, block, box, cylinder, ellipsoid, rod, wedge
from modt_simulation.terrain import Terrain
from modt_simulation.world import World
from tools.train.worlds import Worlds

RANGE_M = (2.0, 40.0)
"""Least and greatest distance of the middle of a thing."""
MARGIN_M = 0.6
"""Least free distance between the sensor and a thing."""
THINGS = (10, 30)
"""Least and greatest number of solid things of a scene."""
MOUNDS = (4, 22)
"""Least and greatest number of mounds of a scene, which are part of its ground."""
HALF_M = 46.0
"""Half the side of the ground."""
CELL_M = 0.2
"""Side of a cell of the ground."""
STEEPEST = 3.0
"""Tangent of the rays that may meet the rising ground."""
ROWS_SHARE = 0.25
"""Share of the scenes with rows of young trees."""
PLAIN_SHARE = 0.35
"""Share of the scenes with level ground between the mounds."""
EARTH = (Material.GRASS, Material.PAVING, Material.ASPHALT, Material.WALL, Material.BARK)
"""Materials of heaps: they differ in reflectance, not in shape."""


def bare_scene(rng: Generator, height_m: float) -> World:
    """A robot at rest among heaps and plants, without people, vehicles and animals."""
    builder = SceneBuilder(rng, 4.0)
    if rng.random() < ROWS_SHARE:
        _rows(builder)
    for _ in range(rng.integers(*THINGS)):
        solids, reach_m = _thing(rng)
        x, y = _place(rng, reach_m)
        builder.scenery(solids, x, y, float(rng.uniform(-np.pi, np.pi)))
    return builder.world(_ground(rng), Path.standing(0.0, 0.0, 0.0), height_m, sway_rad=0.004, ego_m=(0.4, 0.4))


def _place(rng: Generator, reach_m: float) -> tuple[float, float]:
    """Place of a thing that reaches so far from its middle."""
    nearest, farthest = RANGE_M
    distance = float(np.exp(rng.uniform(np.log(max(nearest, reach_m + MARGIN_M)), np.log(farthest))))
    bearing = rng.uniform(-np.pi, np.pi)
    return distance * np.cos(bearing), distance * np.sin(bearing)


def _thing(rng: Generator) -> tuple[Solids, float]:
    """A random thing, and how far it reaches from its middle [m]."""
    make = MAKERS[int(rng.choice(len(MAKERS)))]
    solids = make(rng)
    reach_m = np.hypot(*(np.abs(solids.centre[:, :2]) + np.linalg.norm(solids.half, axis=1)[:, None]).max(axis=0))
    return solids, float(reach_m)


def _size(rng: Generator) -> Triple:
    """Half the length, half the width and the height of a heap [m]: often as large as a car."""
    half_length = float(np.exp(rng.uniform(np.log(0.35), np.log(3.0))))
    half_width = half_length * rng.uniform(0.4, 1.0)
    return half_length, half_width, float(np.clip(half_width * rng.uniform(0.4, 1.6), 0.3, 2.6))


def _earth(rng: Generator) -> Material:
    return EARTH[int(rng.choice(len(EARTH)))]


def _dome(rng: Generator) -> Solids:
    """A smooth heap, of which a part lies below the ground."""
    half_length, half_width, height = _size(rng)
    sunk = rng.uniform(0.0, 0.6) * height
    return ellipsoid((0.0, 0.0, -sunk), (half_length, half_width, height + sunk), _earth(rng))


def _roof(rng: Generator) -> Solids:
    """A ridge with two or four plane sides, as gravel lies when it is tipped."""
    half_length, half_width, height = _size(rng)
    blunt = rng.uniform(0.75, 1.1)
    cuts = [(0.0, side / half_width, 1.0 / height, blunt) for side in (-1, 1)]
    if rng.random() < 0.7:
        cuts += [(side / half_length, 0.0, 1.0 / height, blunt) for side in (-1, 1)]
    # The frame of a wedge begins at its middle; the cuts are planes through the foot of each side.
    cuts = [(a, b, c, d - c * height / 2) for a, b, c, d in cuts]
    return wedge((0.0, 0.0, height / 2), (2 * half_length, 2 * half_width, height), _earth(rng), cuts)


def _cone(rng: Generator) -> Solids:
    """A cone of discs, each smaller than the one below."""
    radius, _, height = _size(rng)
    level = np.arange(0.0, 1.0, rng.uniform(0.05, 0.12))
    thick = (level[1] - level[0]) * height if len(level) > 1 else height
    material = _earth(rng)
    shape = rng.uniform(0.6, 1.6)
    discs = [
        cylinder((0.0, 0.0, z * height + thick / 2), radius * (1 - z) ** shape + 0.05, thick, material)
        for z in level.tolist()
    ]
    return Solids.join(discs)


def _boulder(rng: Generator) -> Solids:
    """One to three rocks: turned ellipsoids with broken sides."""
    parts = []
    for _ in range(rng.integers(1, 4)):
        radius = float(np.exp(rng.uniform(np.log(0.25), np.log(1.4))))
        semi = radius * rng.uniform(0.6, 1.2, 3)
        rock = ellipsoid((0.0, 0.0, 0.0), tuple(semi.tolist()), Material.WALL)
        for cut in range(4):
            normal = rng.standard_normal(3)
            normal /= np.linalg.norm(normal)
            rock.cuts[0, cut] = np.append(normal, rng.uniform(0.6, 1.0) * radius)
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        x, y = rng.normal(0.0, 0.8 * radius, 2)
        parts.append(rock.transformed(turn, np.array([x, y, rng.uniform(0.0, 0.7) * radius])))
    return Solids.join(parts)


def _rubble(rng: Generator) -> Solids:
    """A heap with a rough surface: stones, bricks and planks that lie on a core."""
    half_length, half_width, height = size = _size(rng)
    core = ellipsoid((0.0, 0.0, 0.0), size, _earth(rng))
    parts = [core]
    grain = rng.uniform(0.05, 0.3)
    for _ in range(rng.integers(15, 60)):
        bearing = rng.uniform(-np.pi, np.pi)
        rise = rng.uniform(0.0, np.pi / 2)
        x = 0.95 * half_length * np.cos(rise) * np.cos(bearing)
        y = 0.95 * half_width * np.cos(rise) * np.sin(bearing)
        half = grain * np.exp(rng.uniform(-0.7, 0.7, 3))
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        stone = box((0.0, 0.0, 0.0), tuple((2 * half).tolist()), _earth(rng))
        parts.append(stone.transformed(turn, np.array([x, y, 0.95 * height * np.sin(rise)])))
    return Solids.join(parts)


def _bank(rng: Generator) -> Solids:
    """A long, low bank of a few rounded pieces in a row."""
    length = rng.uniform(2.0, 9.0)
    tall = rng.uniform(0.35, 1.8)
    deep = tall * rng.uniform(0.6, 1.8)
    material = _earth(rng)
    parts = []
    for x in np.arange(-length / 2, length / 2 + 0.1, rng.uniform(0.7, 2.0)):
        semi = (rng.uniform(0.9, 2.0), deep * rng.uniform(0.7, 1.1), tall * rng.uniform(0.7, 1.1))
        parts.append(ellipsoid((float(x), rng.normal(0.0, 0.15), 0.0), semi, material))
    return Solids.join(parts)


def _stack(rng: Generator) -> Solids:
    """Logs, pipes or bales, one layer upon the other."""
    radius = rng.uniform(0.08, 0.65)
    length = rng.uniform(0.8, 4.0)
    material = Material.BARK if rng.random() < 0.6 else Material.WOOD
    n = int(rng.integers(1, max(2, round(1.6 / radius)) + 1))
    parts = []
    for layer in range(int(rng.integers(1, n + 1))):
        for k in range(n - layer):
            y = (2 * k - (n - layer - 1)) * radius
            x = rng.normal(0.0, 0.05 * length)
            z = radius * (1 + 1.73 * layer)
            parts.append(rod((x - length / 2, y, z), (x + length / 2, y, z), radius, material))
    return Solids.join(parts)


def _bush(rng: Generator) -> Solids:
    """A bush or a tuft, dense or loose."""
    half_length, half_width, height = _size(rng)
    parts = []
    for _ in range(rng.integers(1, 7)):
        size = rng.uniform(0.4, 1.0)
        x = 0.5 * half_length * rng.standard_normal() * (1 - size)
        y = 0.5 * half_width * rng.standard_normal() * (1 - size)
        semi = (size * half_length, size * half_width, 0.55 * size * height)
        z = rng.uniform(0.2, 1.0) * height - semi[2]
        parts.append(ellipsoid((x, y, max(z, 0.1)), semi, Material.FOLIAGE, float(np.exp(rng.uniform(-0.5, 2.2)))))
    return Solids.join(parts)


def sapling(rng: Generator) -> Solids:
    """A young or pruned tree, vine or shrub: a thin trunk, branches, and foliage that hangs low."""
    bare = rng.uniform(0.3, 1.9)
    parts = [cylinder((0.0, 0.0, bare / 2 + 0.2), rng.uniform(0.02, 0.12), bare + 0.4, Material.BARK)]
    for _ in range(rng.integers(0, 6)):
        bearing = rng.uniform(-np.pi, np.pi)
        reach = rng.uniform(0.3, 1.3)
        rise = rng.uniform(-0.2, 0.9)
        z = bare * rng.uniform(0.6, 1.0)
        tip = (reach * np.cos(bearing), reach * np.sin(bearing), z + rise)
        parts.append(rod((0.0, 0.0, z), tip, rng.uniform(0.01, 0.04), Material.BARK))
    spread = rng.uniform(0.25, 1.1)
    density = rng.uniform(0.5, 3.5)
    for _ in range(rng.integers(2, 10)):
        x, y = rng.normal(0.0, spread, 2)
        size = rng.uniform(0.15, 0.7)
        z = bare + rng.uniform(-0.4, 1.6)
        semi = (size, size * rng.uniform(0.7, 1.2), size * rng.uniform(0.6, 1.3))
        parts.append(ellipsoid((x, y, max(z, 0.3)), semi, Material.FOLIAGE, density * rng.uniform(0.7, 1.4)))
    return Solids.join(parts)


def _slab(rng: Generator) -> Solids:
    """A block of stone, a trough or a piece of a wall."""
    half_length, half_width, height = _size(rng)
    return block((2 * half_length, half_width, height), Material.WALL)


def _thicket(rng: Generator) -> Solids:
    return scenery.thicket(rng)


MAKERS: tuple[Callable[[Generator], Solids], ...] = (
    _dome, _dome, _dome, _roof, _roof, _cone, _boulder, _rubble, _rubble, _bank, _stack, _bush, _bush, sapling,
    sapling, _slab, _thicket,
)  # fmt: skip


def _rows(builder: SceneBuilder) -> None:
    """Add rows of young trees or vines on both sides of the robot."""
    rng = builder.rng
    gap = rng.uniform(2.2, 5.5)
    step = rng.uniform(1.2, 4.0)
    turn = rng.uniform(-np.pi, np.pi)
    for row in (-2.5, -1.5, -0.5, 0.5, 1.5, 2.5):
        for along in np.arange(-16.0, 16.0, step) + rng.uniform(0.0, step):
            x = along + rng.normal(0.0, 0.2)
            y = row * gap + rng.normal(0.0, 0.1)
            c, s = np.cos(turn), np.sin(turn)
            builder.scenery(sapling(rng), float(c * x - s * y), float(s * x + c * y))


def _ground(rng: Generator) -> Terrain:
    """Ground with mounds: level or wavy between them, smooth or rough."""
    n = int(2 * HALF_M / CELL_M)
    across = ((np.arange(n) + 0.5) * CELL_M - HALF_M).astype(np.float64)
    x = across[:, None]
    y = across[None]
    height = np.zeros((n, n))
    if rng.random() > PLAIN_SHARE:
        wave_m = rng.uniform(9.0, 45.0)
        noise = ndimage.gaussian_filter(rng.standard_normal((n, n)), wave_m / 4 / CELL_M, mode="wrap")
        height += rng.uniform(0.02, 0.035) * wave_m * rng.random() * noise / noise.std()
    mounds = np.zeros((n, n))
    for _ in range(rng.integers(*MOUNDS)):
        np.maximum(mounds, _mound(rng, x, y), out=mounds)
    # A mound is as rough as its material: fine, or in lumps of half a metre.
    lumps = ndimage.gaussian_filter(rng.standard_normal((n, n)), rng.uniform(0.7, 2.5), mode="wrap")
    height += mounds * (1.0 + rng.uniform(0.0, 0.25) * lumps / lumps.std())
    height += rng.standard_normal((n, n)) * rng.uniform(0.004, 0.04)
    height -= height[n // 2, n // 2]
    material = np.full((n, n), _earth(rng), np.uint8)
    return Terrain(np.array([-HALF_M, -HALF_M]), CELL_M, height.astype(np.float32), material, STEEPEST)


def _mound(rng: Generator, x: Float64, y: Float64) -> Float64:
    """(X, Y) height of a mound over the ground."""
    half_length, half_width, tall = _size(rng)
    at_x, at_y = _place(rng, half_length)
    turn = rng.uniform(-np.pi, np.pi)
    along = (np.cos(turn) * (x - at_x) + np.sin(turn) * (y - at_y)) / half_length
    aside = (np.cos(turn) * (y - at_y) - np.sin(turn) * (x - at_x)) / half_width
    radius = np.hypot(along, aside)
    kind = rng.choice(4)
    if kind == 0:  # cone
        shape = np.clip(1.0 - radius, 0.0, None)
    elif kind == 1:  # bell
        shape = np.exp(-2.5 * radius**2) * (radius < 2.0)
    elif kind == 2:  # dome
        shape = np.sqrt(np.clip(1.0 - radius**2, 0.0, None))
    else:  # ridge with a flat top
        shape = np.clip(2.0 * (1.0 - np.maximum(np.abs(along), np.abs(aside))), 0.0, 1.0)
    return np.asarray(tall * shape, np.float64)


def _at_height(sensor: str, height_m: float) -> ProfileConfig:
    """The profile of a sensor, for a mount at this height."""
    config = profile.load(sensor)
    return replace(config, sensor=replace(config.sensor, height_m=height_m))


bare_scans = Worlds(
    name="bare",
    stream=5,
    scene=bare_scene,
    height_m=(0.25, 2.2),
    usual_height_share=0.4,
    sweeps=10,
    profile=_at_height,
).scans
