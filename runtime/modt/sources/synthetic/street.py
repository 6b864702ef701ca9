"""A residential street that the ego vehicle drives along."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.sources.synthetic import kinds, scenery
from modt.sources.synthetic.builder import Builder
from modt.sources.synthetic.materials import Material
from modt.sources.synthetic.motion import Path, timetable
from modt.sources.synthetic.terrain import Terrain
from modt.sources.synthetic.world import World
from modt.types import Float64

MARGIN_M, CELL_M = 95.0, 0.25


@dataclass(frozen=True)
class Layout:
    """The lie of the street.

    Attributes:
        start_m, end_m: where it begins and ends along x.
        half_m: half the width of the carriageway.
        pavement_m: width of each pavement.
        front_m: distance of the house fronts from the middle.
        bend_m, wave_m: how far it swings to the sides, and over what length.
        grade: rise of the ground along x.
    """

    start_m: float
    end_m: float
    half_m: float
    pavement_m: float
    front_m: float
    bend_m: float
    wave_m: float
    grade: float

    def middle(self, x: Float64) -> Float64:
        """Y of the middle of the road at x."""
        return np.asarray(self.bend_m * np.sin(2 * np.pi * x / self.wave_m))

    def heading(self, x: Float64) -> Float64:
        """Direction of the road at x [rad]."""
        return np.asarray(np.arctan(self.bend_m * 2 * np.pi / self.wave_m * np.cos(2 * np.pi * x / self.wave_m)))

    def place(self, x: float, left_m: float, turn: float = 0.0) -> tuple[float, float, float]:
        """x, y and heading of a place left of the middle of the road, turned from its direction."""
        yaw = float(self.heading(np.array(x)))
        y = float(self.middle(np.array(x)))
        return x - left_m * np.sin(yaw), y + left_m * np.cos(yaw), yaw + turn

    def lane(self, left_m: float, backwards: bool = False) -> Float64:
        """(n, 2) line along the road, left of its middle."""
        x = np.arange(self.start_m, self.end_m, 4.0)
        yaw = self.heading(x)
        line = np.stack([x - left_m * np.sin(yaw), self.middle(x) + left_m * np.cos(yaw)], axis=1)
        return line[::-1] if backwards else line

    def terrain(self, rng: np.random.Generator) -> Terrain:
        """Cambered carriageway, kerbs, pavements and rough ground behind."""
        corner = np.array([self.start_m, -75.0])
        x = corner[0] + CELL_M * np.arange(int((self.end_m - self.start_m) / CELL_M))
        y = corner[1] + CELL_M * np.arange(int(150 / CELL_M))
        side = np.abs((y - self.middle(x)[:, None]) * np.cos(self.heading(x))[:, None]).astype(np.float32)
        road, walk = side < self.half_m, side < self.half_m + self.pavement_m
        height = np.where(road, -0.02 * side, np.where(walk, 0.12 - 0.02 * self.half_m, 0.1)).astype(np.float32)
        rough = rng.standard_normal(height.shape, np.float32) * np.float32(0.015)
        height += np.where(walk, 0, rough) + (self.grade * x)[:, None].astype(np.float32)
        surface = np.where(road, Material.ASPHALT, np.where(walk, Material.PAVING, Material.GRASS))
        return Terrain(corner, CELL_M, height, surface.astype(np.int64))


def street(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """Houses, gardens, trees, parked and moving traffic and people along a gently winding street."""
    knots = rng.uniform(4.0, 8.0, max(3, round(seconds / 2.5) + 1))
    if seconds >= 8:
        knots[len(knots) // 2] = rng.uniform(0.5, 2.5)
    speed = np.interp(np.linspace(0, 1, 200), np.linspace(0, 1, len(knots)), knots)
    time, travelled = timetable(seconds, speed, MARGIN_M)
    way = Layout(
        start_m=-MARGIN_M,
        end_m=float(travelled[-1]) + 40.0,
        half_m=rng.uniform(3.6, 4.6),
        pavement_m=rng.uniform(1.8, 2.8),
        front_m=rng.uniform(9.5, 12.5),
        bend_m=rng.uniform(1.5, 4.0),
        wave_m=rng.uniform(180.0, 300.0),
        grade=rng.uniform(-0.02, 0.02),
    )
    builder = Builder(rng, seconds)
    for side in (-1, 1):
        _row_of_houses(builder, way, side)
        _roadside(builder, way, side)
        _parked(builder, way, side)
        _people(builder, way, side)
    _traffic(builder, way, float(speed.mean()))
    ego = Path(way.lane(-way.half_m * 0.45), time, travelled)
    return builder.world(way.terrain(rng), ego, height_m)


def _row_of_houses(builder: Builder, way: Layout, side: int) -> None:
    rng, x = builder.rng, way.start_m
    while x < way.end_m:
        length, depth = rng.uniform(8.0, 18.0), rng.uniform(8.0, 12.0)
        set_back = way.front_m + rng.uniform(-1.0, 4.0)
        if rng.random() < 0.85:
            spot = way.place(x + length / 2, side * (set_back + depth / 2), 0.0 if side > 0 else np.pi)
            builder.scenery(scenery.building(rng, length, depth, rng.uniform(5.5, 11.0)), *spot)
        _garden(builder, way, side, x, length, set_back)
        x += length + rng.choice([0.5, 3.0, 6.0, 12.0], p=[0.3, 0.3, 0.25, 0.15])


def _garden(builder: Builder, way: Layout, side: int, x: float, length: float, set_back: float) -> None:
    """What lies between pavement and house."""
    rng = builder.rng
    edge = way.half_m + way.pavement_m + 0.4
    gate = rng.uniform(1.2, 3.5)
    run = length - gate
    make = rng.choice(5)
    if make < 3 and run > 2:
        border = (scenery.fence, scenery.hedge, scenery.wall)[make]
        builder.scenery(border(rng, run), *way.place(x + run / 2, side * edge))
    for _ in range(int(rng.integers(1, 5))):
        spot = way.place(x + rng.uniform(0, length), side * rng.uniform(edge + 0.8, max(set_back - 0.5, edge + 1.2)))
        builder.scenery(scenery.shrub(rng, rng.uniform(0.5, 1.6)), *spot)
    if rng.random() < 0.35:
        spot = way.place(x + rng.uniform(0, length), side * (edge + 1.5))
        builder.scenery(scenery.tree(rng), *spot)


def _roadside(builder: Builder, way: Layout, side: int) -> None:
    """Trees, lamps, signs and bins at the edge of the pavement."""
    rng, x = builder.rng, way.start_m + rng_start(builder)
    while x < way.end_m:
        make = rng.choice(5, p=[0.3, 0.22, 0.18, 0.2, 0.1])
        off = way.half_m + (0.5 if make in (1, 2) else rng.uniform(0.5, way.pavement_m))
        spot = way.place(x, side * off, 0.0 if side < 0 else np.pi)
        if make == 4:
            builder.parked_bicycle(*spot)
        else:
            builder.scenery((scenery.tree, scenery.pole, scenery.sign, scenery.bin_)[make](rng), *spot)
        x += rng.uniform(3.0, 11.0)


def rng_start(builder: Builder) -> float:
    """A first gap."""
    return float(builder.rng.uniform(0.0, 8.0))


def _parked(builder: Builder, way: Layout, side: int) -> None:
    rng, x = builder.rng, way.start_m
    share = rng.uniform(0.35, 0.75)
    while x < way.end_m:
        if rng.random() < share:
            kind = rng.choice(3, p=[0.86, 0.11, 0.03])
            turn = (0.0 if rng.random() < 0.8 else np.pi) + (np.pi if side > 0 else 0.0) + rng.normal(0, 0.02)
            spot = way.place(x, side * (way.half_m + 0.1 + rng.normal(0, 0.08)), turn)
            builder.vehicle((kinds.CAR, kinds.VAN, kinds.TRUCK)[kind], Path.standing(*spot))
            x += 4.2 if kind == 2 else 0.4
        x += rng.uniform(5.4, 7.5)


def _people(builder: Builder, way: Layout, side: int) -> None:
    rng, x = builder.rng, way.start_m
    walk = way.half_m + 1.3
    while x < way.end_m:
        x += rng.exponential(16.0)
        left = side * (walk + rng.uniform(0.0, max(way.pavement_m - 1.2, 0.1)))
        if rng.random() < 0.65:
            backwards = bool(rng.random() < 0.5)
            speed = float(np.clip(rng.normal(1.35, 0.2), 0.7, 2.2))
            for beside in range(int(rng.choice([1, 1, 1, 2]))):
                line = way.lane(left + side * 0.75 * beside, backwards)
                start = (way.end_m - x) if backwards else (x - way.start_m)
                builder.pedestrian(Path.steady(line, start, speed, builder.seconds), speed)
        else:
            for _ in range(int(rng.integers(1, 4))):
                spot = way.place(x + rng.normal(0, 0.8), left + rng.normal(0, 0.4), rng.uniform(-np.pi, np.pi))
                builder.pedestrian(Path.standing(*spot))


def _traffic(builder: Builder, way: Layout, pace_mps: float) -> None:
    rng, seconds = builder.rng, builder.seconds
    for line, gap in ((way.lane(-way.half_m + 1.35), 8.0), (way.lane(way.half_m - 1.35, True), 0.0)):
        s = MARGIN_M + gap
        for _ in range(3):
            speed = float(rng.uniform(3.0, 5.5))
            builder.cyclist(Path.steady(line, s, speed, seconds), speed)
            s += rng.uniform(8.0, 40.0)
    ahead, oncoming = way.lane(-way.half_m * 0.45), way.lane(way.half_m * 0.45, backwards=True)
    s = MARGIN_M + rng.uniform(14.0, 30.0)
    for _ in range(3):
        builder.vehicle(kinds.CAR, Path.steady(ahead, s, pace_mps * 1.1, seconds))
        s += rng.uniform(14.0, 40.0)
    s = 0.0
    while s < way.end_m + 60.0:
        kind = (kinds.CAR, kinds.VAN, kinds.TRUCK)[rng.choice(3, p=[0.8, 0.14, 0.06])]
        builder.vehicle(kind, Path.steady(oncoming, s, rng.uniform(7.0, 9.0), seconds))
        s += rng.uniform(28.0, 70.0)
