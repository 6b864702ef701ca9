"""Roads and the terrain around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy import ndimage

from modt.types import Float32, Float64
from modt_simulation.materials import Material
from modt_simulation.solids import Pair, Triple
from modt_simulation.terrain import Terrain

CELL_M = 0.25
"""Side of a cell of the terrain."""
MARGIN_M = 80.0
"""Width of the terrain on each side of a road."""
KERB_M = 0.12
"""Height of the kerb."""
CAMBER = 0.02
"""Slope of a carriageway to both sides [m/m]."""
ROUGHNESS_M = 0.012
"""Standard deviation of the height of each cell."""


@dataclass(frozen=True)
class Road:
    """A sinusoidal road; the x axis of its frame runs along it, positive offsets are to the left."""

    start_m: float  # start along x
    end_m: float  # end along x
    half_m: float  # half the width of the carriageway
    pavement_m: float  # width of each pavement
    front_m: float  # distance of the house fronts from the centre line
    bend_m: float = 0.0  # amplitude of the centre line
    wave_m: float = 200.0  # wavelength of the centre line
    turn_rad: float = 0.0  # direction of x in the world
    gaps: tuple[Pair, ...] = ()  # stretches (from, to) along x occupied by other roads

    def free(self, x: float) -> bool:
        """Whether no other road occupies x [m]."""
        return not any(a <= x <= b for a, b in self.gaps)

    def middle(self, x: Float64) -> Float64:
        """Offset of the centre line at x [m]."""
        return np.asarray(self.bend_m * np.sin(2 * np.pi * x / self.wave_m))

    def heading(self, x: Float64) -> Float64:
        """Direction of the centre line at x, from the x axis [rad]."""
        return np.asarray(np.arctan(self.bend_m * 2 * np.pi / self.wave_m * np.cos(2 * np.pi * x / self.wave_m)))

    def place(self, x: float, left_m: float, turn: float = 0.0) -> Triple:
        """World x, y and heading of a place left of the centre line, turned from its direction."""
        along = np.array([x])
        spot = self._left_of_centre(along, left_m)
        return float(spot[0, 0]), float(spot[0, 1]), float(self.heading(along)[0]) + turn + self.turn_rad

    def lane(self, left_m: float, backwards: bool = False) -> Float64:
        """(n, 2) line along the road, left of the centre line, world."""
        line = self._left_of_centre(np.arange(self.start_m, self.end_m, 4.0), left_m)
        return line[::-1] if backwards else line

    def distance_to_centre(self, x: Float32, y: Float32) -> Float32:
        """Distance of world points from the centre line [m]."""
        c = np.float32(np.cos(self.turn_rad))
        s = np.float32(np.sin(self.turn_rad))
        along = c * x + s * y
        across = c * y - s * x
        if not self.bend_m:
            return np.abs(across)
        table = np.arange(self.start_m - 200, self.end_m + 200, 1.0)
        swing = np.interp(along, table, self.middle(table)).astype(np.float32)
        slant = np.interp(along, table, np.cos(self.heading(table))).astype(np.float32)
        return np.asarray(np.abs((across - swing) * slant))

    def _left_of_centre(self, x: Float64, left_m: float) -> Float64:
        """(n, 2) world points at x (n,), left of the centre line."""
        yaw = self.heading(x)
        xy = np.stack([x - left_m * np.sin(yaw), self.middle(x) + left_m * np.cos(yaw)], axis=1)
        c = np.cos(self.turn_rad)
        s = np.sin(self.turn_rad)
        return np.asarray(xy @ np.array([[c, s], [-s, c]]))


def terrain_along(rng: Generator, road: Road) -> Terrain:
    """Terrain along one road, MARGIN_M to both sides."""
    return terrain(rng, [road], (road.start_m, -MARGIN_M), (road.end_m, MARGIN_M))


def terrain(rng: Generator, roads: list[Road], low: Pair, high: Pair) -> Terrain:
    """Cambered carriageways, kerbs, pavements and rough ground behind, between two corners [m, world]."""
    x = np.arange(low[0], high[0], CELL_M, dtype=np.float32)
    y = np.arange(low[1], high[1], CELL_M, dtype=np.float32)
    sides = [np.broadcast_to(r.distance_to_centre(x[:, None], y[None]), (len(x), len(y))) for r in roads]
    # distance beyond the kerb of the nearest road, negative on its carriageway, and on a pavement or a carriageway
    beyond = np.minimum.reduce([side - road.half_m for side, road in zip(sides, roads, strict=True)])
    carriage = np.logical_or.reduce([side < road.half_m for side, road in zip(sides, roads, strict=True)])
    walk = np.logical_or.reduce([s < road.half_m + road.pavement_m for s, road in zip(sides, roads, strict=True)])
    behind = np.maximum(beyond - roads[0].pavement_m, 0)
    rough = _roughness(rng, len(x), len(y)) * np.minimum(behind, 1.0)
    bank = np.float32(rng.uniform(-0.02, 0.05)) * np.minimum(behind, 15.0)
    half = roads[0].half_m
    camber = 0.0 if len(roads) > 1 else CAMBER  # none where two roads cross
    kerb = np.float32(KERB_M - camber * half)
    height = np.where(carriage, -np.float32(camber) * (beyond + half), kerb + bank + rough).astype(np.float32)
    grade = rng.uniform(-0.02, 0.02, 2) * (1.0, 0.5)
    height += np.float32(grade[0]) * x[:, None] + np.float32(grade[1]) * y
    for _ in range(2):
        height += _swell(rng, x, y)
    height += rng.standard_normal(height.shape, np.float32) * np.float32(ROUGHNESS_M)
    surface = np.where(carriage, Material.ASPHALT, np.where(walk, Material.PAVING, Material.GRASS))
    return Terrain(np.array(low, np.float64), CELL_M, height, surface.astype(np.uint8))


def _swell(rng: Generator, x: Float32, y: Float32) -> Float32:
    """(X, Y) height of a long wave of the ground at x (X,) and y (Y,) [m]."""
    k = 2 * np.pi / rng.uniform(90.0, 250.0)
    phase = rng.uniform(0, 2 * np.pi)
    lift = rng.uniform(0.0, 0.5)
    bearing = rng.uniform(-0.5, 0.5)
    along = np.float32(k * np.cos(bearing)) * x[:, None] + np.float32(k * np.sin(bearing)) * y
    return np.asarray(np.float32(lift) * np.sin(along + np.float32(phase)))


def _roughness(rng: Generator, rows: int, columns: int) -> Float32:
    """(X, Y) unevenness of open ground [m], smooth over metres plus tussocks of one cell."""
    coarse = rng.standard_normal((rows // 8 + 2, columns // 8 + 2), np.float32)
    swell = ndimage.zoom(coarse, 8, order=1)[:rows, :columns]
    fine = rng.standard_normal((rows, columns), np.float32)
    return np.asarray(np.float32(0.06) * swell + np.float32(0.025) * np.abs(fine) * (1 + np.maximum(swell, 0)))
