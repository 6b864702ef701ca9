"""Houses, furniture, parked vehicles, traffic and pedestrians along a road."""

from __future__ import annotations

import numpy as np

from modt_simulation import kinds, scenery
from modt_simulation.builder import SceneBuilder, clipped_normal
from modt_simulation.motion import Path
from modt_simulation.road import Road

LANE = 0.45
"""Centre of a lane, as a share of half the carriageway."""
VEHICLES = (kinds.CAR, kinds.VAN, kinds.TRUCK)


def houses(builder: SceneBuilder, road: Road, side: int, density: float, vegetation: float) -> None:
    """Add a row of houses with gardens, and a second row of houses and trees behind."""
    rng = builder.rng
    x = road.start_m
    while x < road.end_m:
        length = rng.uniform(8.0, 18.0)
        depth = rng.uniform(8.0, 12.0)
        set_back = road.front_m + rng.uniform(-1.0, 4.0)
        built = rng.random() < density
        if road.free(x - 2) and road.free(x + length / 2) and road.free(x + length + 2):
            if built:
                spot = road.place(x + length / 2, side * (set_back + depth / 2), 0.0 if side > 0 else np.pi)
                builder.scenery(scenery.building(rng, length, depth, rng.uniform(5.5, 11.0)), *spot)
            _garden(builder, road, side, x, length, set_back if built else set_back + 12.0, vegetation)
            behind = side * (set_back + depth + rng.uniform(6.0, 22.0))
            spot = road.place(x + rng.uniform(0, length), behind, rng.uniform(-0.2, 0.2))
            far_house = rng.random() < 0.5
            back = scenery.building(rng, length, depth, rng.uniform(5.0, 9.0)) if far_house else scenery.tree(rng)
            builder.scenery(back, *spot)
        x += length + rng.choice([0.5, 3.0, 6.0, 12.0], p=[0.3, 0.3, 0.25, 0.15])


def _garden(
    builder: SceneBuilder, road: Road, side: int, x: float, length: float, set_back: float, vegetation: float
) -> None:
    """Add a border with a gate, bushes, plants and trees between pavement and house."""
    rng = builder.rng
    edge = road.half_m + road.pavement_m + 0.4
    run = length - rng.uniform(1.2, 3.5)
    make = rng.choice(5)
    if make < 3 and run > 2:
        border = (scenery.fence, scenery.hedge, scenery.wall)[make]
        builder.scenery(border(rng, run), *road.place(x + run / 2, side * edge))
    deep = max(set_back - 0.5 - edge, 1.5)
    for _ in range(rng.poisson(2.5 * vegetation)):
        spot = road.place(x + rng.uniform(0, length), side * (edge + rng.uniform(0.8, deep)))
        builder.scenery(scenery.shrub(rng, rng.uniform(0.5, 1.6)), *spot)
    for _ in range(rng.choice(3, p=[0.65, 0.27, 0.08])):
        off = edge + rng.uniform(0.8, deep)
        builder.scenery(scenery.thicket(rng), *road.place(x + rng.uniform(0, length), side * off, rng.normal(0, 0.5)))
    plants = scenery.plants(rng, length, deep, rng.poisson(0.06 * vegetation * length * deep))
    builder.scenery(plants, *road.place(x + length / 2, side * (edge + deep / 2)))
    for _ in range(rng.choice(3, p=[0.5, 0.35, 0.15])):
        spot = road.place(x + rng.uniform(0, length), side * (edge + rng.uniform(1.0, deep)))
        builder.scenery(scenery.tree(rng), *spot)


def furniture(builder: SceneBuilder, road: Road, side: int) -> None:
    """Add trees, lamps, signs, bins and bicycles on the pavement."""
    rng = builder.rng
    x = road.start_m + rng.uniform(0.0, 8.0)
    while x < road.end_m:
        make = rng.choice(5, p=[0.28, 0.22, 0.18, 0.24, 0.08])
        off = road.half_m + (0.5 if make in (1, 2) else rng.uniform(0.5, road.pavement_m))
        spot = road.place(x, side * off, 0.0 if side < 0 else np.pi)
        if road.free(x):
            if make == 4:
                builder.parked_bicycle(*spot)
            else:
                builder.scenery((scenery.tree, scenery.pole, scenery.sign, scenery.bin_)[make](rng), *spot)
        x += rng.uniform(3.0, 11.0)


def parked(builder: SceneBuilder, road: Road, side: int, share: float) -> None:
    """Add vehicles along the kerb, on a share of the parking spaces."""
    rng = builder.rng
    x = road.start_m
    while x < road.end_m:
        if rng.random() < share and road.free(x - 3) and road.free(x + 3):
            kind = VEHICLES[rng.choice(3, p=[0.87, 0.11, 0.02])]
            turn = (0.0 if rng.random() < 0.8 else np.pi) + (np.pi if side > 0 else 0.0) + rng.normal(0, 0.02)
            spot = road.place(x, side * (road.half_m + 0.1 + rng.normal(0, 0.08)), turn)
            builder.vehicle(kind, Path.standing(*spot))
            x += 4.2 if kind is kinds.TRUCK else 0.4
        x += rng.uniform(5.2, 7.2)


def pedestrians(builder: SceneBuilder, road: Road, side: int, apart_m: float) -> None:
    """Add pedestrians on a pavement, walking alone or in pairs or standing in groups."""
    rng = builder.rng
    x = road.start_m
    walk = road.half_m + 0.9
    while x < road.end_m:
        x += rng.exponential(apart_m)
        left = side * (walk + rng.uniform(0.0, max(road.pavement_m - 1.2, 0.1)))
        if rng.random() < 0.65:
            backwards = rng.random() < 0.5
            speed = clipped_normal(rng, 1.35, 0.2, 0.7, 2.2)
            start = road.end_m - x if backwards else x - road.start_m
            for row in range(rng.choice([1, 1, 1, 2])):
                builder.walker(road.lane(left + side * 0.75 * row, backwards), speed, start)
        elif road.free(x):
            for _ in range(rng.integers(1, 4)):
                spot = road.place(x + rng.normal(0, 0.9), left + rng.normal(0, 0.5), rng.uniform(-np.pi, np.pi))
                builder.pedestrian(Path.standing(*spot))


def crossing_pedestrians(builder: SceneBuilder, road: Road, x: float, n: int) -> None:
    """Add pedestrians that cross the road around x."""
    rng = builder.rng
    far = road.half_m + 1.5
    for _ in range(n):
        side = rng.choice([-1, 1])
        at = x + rng.normal(0, 1.5)
        ends = [road.place(at, side * far)[:2], road.place(at, -side * far)[:2]]
        speed = clipped_normal(rng, 1.4, 0.2, 0.8, 2.0)
        builder.walker(ends, speed, rng.uniform(-0.8 * speed * builder.seconds, far))


def cyclists(builder: SceneBuilder, road: Road) -> None:
    """Add two cyclists at each edge of the carriageway, around x = 0."""
    rng = builder.rng
    for side in (-1, 1):
        line = road.lane(side * (road.half_m - 1.35), backwards=side > 0)
        s = -road.start_m if side < 0 else road.end_m
        s += rng.uniform(-30.0, 10.0)
        for _ in range(2):
            speed = rng.uniform(3.0, 5.5)
            builder.cyclist(Path.steady(line, s, speed, builder.seconds), speed)
            s += rng.uniform(8.0, 40.0)


def traffic(builder: SceneBuilder, road: Road, near_m: float, pace_mps: float) -> None:
    """Add moving vehicles in both lanes; those in the right lane start ahead of near_m at about pace_mps."""
    rng = builder.rng
    ahead = road.lane(-road.half_m * LANE)
    oncoming = road.lane(road.half_m * LANE, backwards=True)
    s = near_m - road.start_m + rng.uniform(14.0, 30.0)
    for _ in range(3):
        builder.vehicle(kinds.CAR, Path.steady(ahead, s, pace_mps * 1.1, builder.seconds))
        s += rng.uniform(14.0, 40.0)
    s = rng.uniform(0.0, 30.0)
    while s < road.end_m - road.start_m:
        kind = VEHICLES[rng.choice(3, p=[0.82, 0.13, 0.05])]
        builder.vehicle(kind, Path.steady(oncoming, s, rng.uniform(7.0, 9.0), builder.seconds))
        s += rng.uniform(28.0, 70.0)
