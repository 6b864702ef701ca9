"""A residential street with the ego vehicle driving along it."""

from __future__ import annotations

import numpy as np

from modt_desk.simulation import roadside
from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.motion import Path, timetable
from modt_desk.simulation.road import Road, terrain_along
from modt_desk.simulation.world import World

LEAD_IN_M = 95.0
"""Length of the road behind the ego vehicle's start."""


def street(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """A winding street with houses, gardens, trees, parked and moving traffic and pedestrians."""
    knots = rng.uniform(4.0, 8.0, max(3, round(seconds / 2.5) + 1))
    if seconds >= 8:
        knots[len(knots) // 2] = rng.uniform(0.5, 2.5)
    speed = np.interp(np.linspace(0, 1, 200), np.linspace(0, 1, len(knots)), knots)
    time, travelled = timetable(seconds, speed, LEAD_IN_M)
    road = residential(rng, float(travelled[-1]))
    builder = SceneBuilder(rng, seconds)
    roadside.cyclists(builder, road, 0.0, 2)
    roadside.crossing_pedestrians(builder, road, rng.uniform(20.0, 50.0), int(rng.integers(0, 4)))
    roadside.traffic(builder, road, 0.0, float(speed.mean()))
    share = rng.uniform(0.3, 0.75)
    for side in (-1, 1):
        roadside.pedestrians(builder, road, side, apart_m=16.0)
        roadside.parked(builder, road, side, share)
    furnish(builder, road)
    ego = Path(road.lane(-road.half_m * roadside.LANE), time, travelled)
    return builder.world(terrain_along(rng, road), ego, height_m)


def residential(rng: np.random.Generator, travelled_m: float) -> Road:
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
