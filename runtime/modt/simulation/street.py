"""A residential street that the ego vehicle drives along."""

from __future__ import annotations

import numpy as np

from modt.simulation import roadside
from modt.simulation.builder import Builder
from modt.simulation.layout import BESIDE_M, Road, terrain
from modt.simulation.motion import Path, timetable
from modt.simulation.world import World

MARGIN_M = 95.0
"""Road behind the ego vehicle's start and ahead of its end."""


def street(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """Houses, gardens, trees, parked and moving traffic and people along a gently winding street."""
    knots = rng.uniform(4.0, 8.0, max(3, round(seconds / 2.5) + 1))
    if seconds >= 8:
        knots[len(knots) // 2] = rng.uniform(0.5, 2.5)
    speed = np.interp(np.linspace(0, 1, 200), np.linspace(0, 1, len(knots)), knots)
    time, travelled = timetable(seconds, speed, MARGIN_M)
    road = residential(rng, float(travelled[-1]))
    builder = Builder(rng, seconds)
    roadside.cyclists(builder, road, 0.0, 2)
    roadside.crossers(builder, road, rng.uniform(20.0, 50.0), int(rng.integers(0, 4)))
    roadside.traffic(builder, road, 0.0, float(speed.mean()))
    share = rng.uniform(0.3, 0.75)
    for side in (-1, 1):
        roadside.people(builder, road, side, apart_m=16.0)
        roadside.parked(builder, road, side, share)
    dress(builder, road)
    ego = Path(road.lane(-road.half_m * roadside.LANE), time, travelled)
    low, high = (road.start_m, -BESIDE_M), (road.end_m, BESIDE_M)
    return builder.world(terrain(rng, [road], low, high), ego, height_m)


def residential(rng: np.random.Generator, travelled_m: float) -> Road:
    """A road of a quarter where people live."""
    return Road(
        start_m=-MARGIN_M,
        end_m=travelled_m + 40.0,
        half_m=rng.uniform(3.6, 4.6),
        pavement_m=rng.uniform(1.8, 2.8),
        front_m=rng.uniform(9.5, 12.5),
        bend_m=rng.uniform(1.5, 4.0),
        wave_m=rng.uniform(180.0, 300.0),
    )


def dress(builder: Builder, road: Road, wild: float = 1.0) -> None:
    """Houses, gardens, more or less overgrown, and street furniture on both sides."""
    density = builder.rng.uniform(0.5, 0.95)
    for side in (-1, 1):
        roadside.houses(builder, road, side, density, wild)
        roadside.furniture(builder, road, side)
