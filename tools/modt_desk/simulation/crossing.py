"""A crossing of two streets with the ego vehicle turning."""

from __future__ import annotations

import itertools

import numpy as np

from modt.types import Float64
from modt_desk.simulation import roadside
from modt_desk.simulation.builder import SceneBuilder
from modt_desk.simulation.motion import Path, timetable
from modt_desk.simulation.road import Road, terrain
from modt_desk.simulation.street import furnish
from modt_desk.simulation.world import World

REACH_M = 110.0


def crossing(rng: np.random.Generator, seconds: float, height_m: float) -> World:
    """Two straight streets; the ego vehicle slows down, turns left or right and drives on."""
    halves = rng.uniform(3.8, 5.5, 2)
    pavement, front = rng.uniform(2.0, 3.2), rng.uniform(11.0, 15.0)
    speed = rng.uniform(6.0, 9.0)
    approach = min(0.5 * speed * seconds, 40.0)
    reach = REACH_M + speed * seconds
    roads = []
    for half, other, turn_rad in ((*halves, 0.0), (*halves[::-1], np.pi / 2)):
        gap = (-other - pavement, other + pavement)
        roads.append(Road(-reach, reach, float(half), pavement, front, turn_rad=turn_rad, gaps=(gap,)))
    line, corner_m = _turn(rng, roads)
    builder = SceneBuilder(rng, seconds)
    for road in roads:
        stop = float(road.gaps[0][1]) + 1.5
        roadside.crossing_pedestrians(builder, road, -stop, int(rng.integers(2, 6)))
        roadside.crossing_pedestrians(builder, road, stop, int(rng.integers(2, 6)))
        roadside.cyclists(builder, road, 0.0, 2)
        roadside.traffic(builder, road, 15.0, rng.uniform(4.0, 7.0))
        share = rng.uniform(0.2, 0.6)
        for side in (-1, 1):
            roadside.pedestrians(builder, road, side, apart_m=14.0)
            roadside.parked(builder, road, side, share)
        furnish(builder, road, vegetation=0.5)
    pace = np.interp(np.linspace(0, 1, 200), [0.0, 0.35, 0.5, 0.65, 1.0], speed * np.array([1.0, 0.6, 0.4, 0.7, 1.0]))
    ego = Path(line, *timetable(seconds, pace, max(corner_m - approach, 0.0)))
    return builder.world(terrain(rng, roads, (-reach, -reach), (reach, reach)), ego, height_m)


def _turn(rng: np.random.Generator, roads: list[Road]) -> tuple[Float64, float]:
    """Way points in along the first road and out along the second, and the distance to the corner [m]."""
    right = bool(rng.random() < 0.5)
    y_in = -roads[0].half_m * roadside.LANE
    x_out = (-1 if right else 1) * roads[1].half_m * roadside.LANE
    radius = rng.uniform(6.0, 7.0) if right else rng.uniform(9.0, 11.0)
    bend = np.linspace(0, np.pi / 2, 10)
    sign = -1.0 if right else 1.0
    x0, y0 = x_out - radius, y_in + sign * radius
    arc = np.stack([x0 + radius * np.sin(bend), y0 - sign * radius * np.cos(bend)], axis=1)
    start = np.array([[roads[0].start_m, y_in]])
    end = np.array([[x_out, sign * roads[1].end_m]])
    line = np.concatenate([start, arc, end])
    return _densified(line), float(x0 - roads[0].start_m)


def _densified(line: Float64) -> Float64:
    """The line with a way point at least every 3 m: headings are interpolated between segments."""
    parts = [np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / 3) + 1))[:-1] for a, b in itertools.pairwise(line)]
    return np.concatenate([*parts, line[-1:]])
