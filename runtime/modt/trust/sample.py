"""A few returns of a sweep, on which all checks of the trust work."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modt.config import SensorConfig
from modt.geometry import inverse
from modt.types import Bool, Float32, Float64, Frame, Int

SAMPLE = 2003
"""Greatest number of points looked at. The step between them is (n - 1) / (SAMPLE - 1) of n
rows. Where n is a multiple of the number of beams, this step is not, so the beams take turns."""
REACH_SHARE = 0.6
"""Share of the range of the sensor within which returns are counted; load shedding cuts the range to it."""
OBSTACLE_M = (0.35, 1.8)
"""Heights above the ground between which a point belongs to an obstacle, not to ground or ceiling [m]."""
NEAREST_M = 0.7
"""Greatest distance of what covers the sensor and is no return [m]."""
DOWN_SHARE = 0.12
"""Share of its range by which a return is far below the sensor, which level ground returns. A ramp seldom tilts the
sensor by more."""
SECTORS = 24
"""Parts of a turn, counted from behind and counter-clockwise."""
GROUND_HEIGHTS = 8.0
GROUND_M = (6.0, 15.0)
"""Range within which the ground is near [heights of the sensor], and its limits [m]."""
RINGS = 15
"""Rings of a metre in which the lowest point of each sector is kept."""


def _cell_centres() -> Float64:
    """Rows 1, x, y of the centres of the cells."""
    bearing = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS) - np.pi
    range_m = np.arange(RINGS) + 0.5
    x = np.outer(np.cos(bearing), range_m).ravel()
    y = np.outer(np.sin(bearing), range_m).ravel()
    return np.stack([np.ones(len(x)), x, y])


CELLS = _cell_centres()
"""(3, SECTORS x RINGS) rows 1, x, y of the centres of the cells [m, level sensor frame]."""
_SPREAD = np.linspace(0.0, 1.0, SAMPLE)


def _rows(n: int) -> Int:
    """(k,) rows of n points, evenly spread."""
    return np.arange(n) if n <= SAMPLE else (_SPREAD * (n - 1)).astype(np.int64)


@dataclass(frozen=True)
class Sample:
    """Some points of a sweep. What the checks need of them is computed once, when it is asked for.

    Attributes:
        time_s: time of the frame [s].
        raw: (k, 3) or wider points, all that are looked at [m, level sensor frame].
        reach_m: range within which they are returns.
        weight: number of points for which one stands.
        plane: (3,) ground z = plane @ (1, x, y) as it was known before.
        T_world_sensor: (4, 4) pose.
        step: (4, 4) pose in the sensor frame of the sweep before.
        pose_given: whether the frame came with a pose, so that the sweeps do not tell their own motion.
        R_level_sensor: (3, 3) from the sensor to the level frame, None if it is level.
    """

    time_s: float
    raw: Float32
    reach_m: float
    weight: float
    plane: Float64
    T_world_sensor: Float64
    step: Float64
    pose_given: bool = True
    R_level_sensor: Float64 | None = None

    @cached_property
    def xyz(self) -> Float32:
        """(3, c) returns: points that neither cover the sensor nor are out of reach."""
        xyz = np.ascontiguousarray(self.raw[:, :3].T)
        square = xyz[0] * xyz[0] + xyz[1] * xyz[1]
        return np.asarray(xyz.compress((square > NEAREST_M**2) & (square < self.reach_m**2), axis=1))

    @cached_property
    def range_m(self) -> Float32:
        """(c,) horizontal ranges of the returns."""
        x, y, _ = self.xyz
        return np.asarray(np.sqrt(x * x + y * y))

    @property
    def tangent_in_sensor(self) -> Float32:
        """(c,) tangents of the elevations of the returns in the sensor's own frame."""
        return self._tangents_in_sensor(self.xyz)

    def _tangents_in_sensor(self, xyz: Float32) -> Float32:
        """(n,) tangents of the elevations of points (3, n) of the level frame in the sensor's own frame."""
        x, y, z = xyz if self.R_level_sensor is None else self.R_level_sensor.T.astype(np.float32) @ xyz
        return np.asarray(z / np.sqrt(x * x + y * y))

    @cached_property
    def turn(self) -> Float32:
        """(c,) bearings of the returns [turns from behind, 0 to 1]."""
        return turn_of(self.xyz[0], self.xyz[1])

    @cached_property
    def sector(self) -> Int:
        """(c,) sectors of the returns."""
        return part_of_turn(self.turn, SECTORS)

    @cached_property
    def far_below(self) -> Bool:
        """(c,) whether a return is far below the sensor, as of the ground nearby or of what stands on it."""
        below: Bool = self.xyz[2] < -DOWN_SHARE * self.range_m
        return below

    @cached_property
    def seen(self) -> Bool:
        """(SECTORS,) whether a sector has any returns."""
        return np.bincount(self.sector, minlength=SECTORS) > 0

    @cached_property
    def obstacles(self) -> Int:
        """(m,) returns that stand above the ground."""
        x, y, z = self.xyz
        a, b, c = self.plane.astype(np.float32)
        height_m = z - (a + b * x + c * y)
        return np.flatnonzero((height_m > OBSTACLE_M[0]) & (height_m < OBSTACLE_M[1]))

    @cached_property
    def lowest_m(self) -> Float32:
        """(SECTORS x RINGS,) z of the lowest return of each cell near the sensor [m, level sensor frame].

        It is infinite in a cell without returns, and where the ground is below all beams of a tilted sensor.
        """
        reach_m = np.clip(GROUND_HEIGHTS * abs(self.plane[0]), *GROUND_M)
        near = np.flatnonzero(self.range_m < reach_m)
        cell = self.sector.take(near) * RINGS + self.range_m.take(near).astype(np.int64)
        lowest_m = np.full(SECTORS * RINGS, np.inf, np.float32)
        np.minimum.at(lowest_m, cell, self.xyz[2].take(near))
        lowest_m[self.below_view] = np.inf
        return lowest_m

    @cached_property
    def below_view(self) -> Bool:
        """(SECTORS x RINGS,) whether the ground in the middle of a cell is below all beams of a tilted sensor."""
        if self.R_level_sensor is None:
            return np.zeros(SECTORS * RINGS, np.bool_)
        ground = np.stack([CELLS[1], CELLS[2], self.plane @ CELLS]).astype(np.float32)
        below: Bool = self._tangents_in_sensor(ground) < self.tangent_in_sensor.min(initial=np.inf)
        return below


Three = tuple[Sample, Sample, Sample]
"""Three sweeps in a row."""


def sample(
    frame: Frame, T_world_sensor: Float64, sensor: SensorConfig, plane: Float64, before: Sample | None = None
) -> Sample:
    """The sample of a level frame over a ground (3,), and after another one."""
    n = len(frame.points)
    rows = _rows(n)
    weight = n / max(len(rows), 1)
    raw = frame.points.take(rows, axis=0)
    reach_m = REACH_SHARE * sensor.max_range_m
    pose_given = frame.T_world_sensor is not None
    step = np.eye(4) if before is None else inverse(before.T_world_sensor) @ T_world_sensor
    return Sample(frame.time_s, raw, reach_m, weight, plane, T_world_sensor, step, pose_given, frame.R_level_sensor)


def part_of_turn(turn: Float32, n: int) -> Int:
    """(c,) part of a turn, of n, in which each bearing [turns] lies."""
    return np.minimum((turn * np.float32(n)).astype(np.int64), n - 1)


def turn_of(x: Float32, y: Float32) -> Float32:
    """(c,) bearings of points [turns from behind, 0 to 1]."""
    return np.asarray(np.arctan2(y, x) * np.float32(0.5 / np.pi) + np.float32(0.5))
