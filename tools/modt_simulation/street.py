"""Streets: a residential one along which the ego vehicle drives, and a crossing at which it turns."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.random import Generator

from modt.types import Float64
from modt_simulation import roadside
from modt_simulation.builder import SceneBuilder
from modt_simulation.motion import Path, timetable
from modt_simulation.road import Road, terrain, terrain_along
from modt_simulation.world import World

LEAD_IN_M = 95.0
"""Length of the road behind the ego vehicle's start."""


def street(rng: Generator, seconds: float, height_m: float) -> World:
    """A winding street with houses, gardens, trees, parked and moving traffic and pedestrians."""
    knots = rng.uniform(4.0, 8.0, max(3, round(seconds / 2.5) + 1))
    if seconds >= 8:
        knots[len(knots) // 2] = rng.uniform(0.5, 2.5)
    speed = np.interp(np.linspace(0, 1, 200), np.linspace(0, 1, len(knots)), knots)
    time, travelled = timetable(seconds, speed, LEAD_IN_M)
    road = residential(rng, float(travelled[-1]))
    builder = SceneBuilder(rng, seconds)
    roadside.cyclists(builder, road)
    roadside.crossing_pedestrians(builder, road, rng.uniform(20.0, 50.0), int(rng.integers(0, 4)))
    roadside.traffic(builder, road, 0.0, float(speed.mean()))
    share = rng.uniform(0.3, 0.75)
    for side in (-1, 1):
        roadside.pedestrians(builder, road, side, apart_m=16.0)
        roadside.parked(builder, road, side, share)
    furnish(builder, road)
    ego = Path(road.lane(-road.half_m * roadside.LANE), time, travelled)
    return builder.world(terrain_along(rng, road), ego, height_m)


def residential(rng: Generator, travelled_m: float) -> Road:
    """A road of random width and bend, with room ahead of travelled_m."""
    return Road(
        start_m=-LEAD_IN_M,
        end_m=travelled_m + 40.0,
        half_m=rng.uniform(3.6, 4.6),
        pavement_m=rng.uniform(1.8, 2.8),
        front_m=rng.uniform(9.5, 12.5),
        bend_m=rng.uniform(1.5, 4.0),
        wave_m=rng.uniform(180.0, 300.0),
    )


def furnish(builder: SceneBuilder, road: Road, vegetation: float = 1.0) -> None:
    """Add houses, gardens and street furniture on both sides."""
    density = builder.rng.uniform(0.5, 0.95)
    for side in (-1, 1):
        roadside.houses(builder, road, side, density, vegetation)
        roadside.furniture(builder, road, side)


REACH_M = 110.0
"""Least length of each street from the crossing."""


def crossing(rng: Generator, seconds: float, height_m: float) -> World:
    """Two straight streets; the ego vehicle slows down, turns left or right and drives on."""
    halves_m = rng.uniform(3.8, 5.5, 2).tolist()
    pavement_m = rng.uniform(2.0, 3.2)
    front_m = rng.uniform(11.0, 15.0)
    speed = rng.uniform(6.0, 9.0)
    approach_m = min(0.5 * speed * seconds, 40.0)
    reach = REACH_M + speed * seconds
    roads = []
    for half_m, other_m, turn_rad in zip(halves_m, halves_m[::-1], (0.0, np.pi / 2), strict=True):
        gap = (-other_m - pavement_m, other_m + pavement_m)
        roads.append(Road(-reach, reach, half_m, pavement_m, front_m, turn_rad=turn_rad, gaps=(gap,)))
    line, corner_m = _turn(rng, roads)
    builder = SceneBuilder(rng, seconds)
    for road in roads:
        _populate(builder, road)
    pace = np.interp(np.linspace(0, 1, 200), [0.0, 0.35, 0.5, 0.65, 1.0], speed * np.array([1.0, 0.6, 0.4, 0.7, 1.0]))
    ego = Path(line, *timetable(seconds, pace, max(corner_m - approach_m, 0.0)))
    return builder.world(terrain(rng, roads, (-reach, -reach), (reach, reach)), ego, height_m)


def _populate(builder: SceneBuilder, road: Road) -> None:
    """Add what stands, walks and drives along one of two streets that cross."""
    rng = builder.rng
    stop = road.gaps[0][1] + 1.5
    for x in (-stop, stop):
        roadside.crossing_pedestrians(builder, road, x, int(rng.integers(2, 6)))
    roadside.cyclists(builder, road)
    roadside.traffic(builder, road, 15.0, rng.uniform(4.0, 7.0))
    share = rng.uniform(0.2, 0.6)
    for side in (-1, 1):
        roadside.pedestrians(builder, road, side, apart_m=14.0)
        roadside.parked(builder, road, side, share)
    furnish(builder, road, vegetation=0.5)


def _turn(rng: Generator, roads: list[Road]) -> tuple[Float64, float]:
    """Way points in along the first road and out along the second, and the distance to the corner [m]."""
    sign = -1.0 if rng.random() < 0.5 else 1.0  # right or left
    y_in = -roads[0].half_m * roadside.LANE
    x_out = sign * roads[1].half_m * roadside.LANE
    radius = rng.uniform(6.0, 7.0) if sign < 0 else rng.uniform(9.0, 11.0)
    bend = np.linspace(0, np.pi / 2, 10)
    x0 = x_out - radius
    y0 = y_in + sign * radius
    arc = np.stack([x0 + radius * np.sin(bend), y0 - sign * radius * np.cos(bend)], axis=1)
    line = np.array([(roads[0].start_m, y_in), *arc, (x_out, sign * roads[1].end_m)])
    # a way point at least every 3 m, since headings are interpolated between segments
    parts = [np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / 3) + 1))[:-1] for a, b in itertools.pairwise(line)]
    return np.concatenate([*parts, line[-1:]]), x0 - roads[0].start_m
