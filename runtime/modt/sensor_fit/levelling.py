"""Attitude of a robot that does not stay level, sweep by sweep.

The mount is the mean attitude. While a robot is steady its sweeps are turned by the mount alone. While it walks or
shakes, each sweep is turned by the floor in it, or by roll and pitch of its pose where no floor shows. A world whose
z axis is not vertical, and a pose without roll and pitch, do no harm: poses count by their difference from the floor,
and where they are constant they count for nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.placement import LEVEL, Mount, from_middle
from modt.sensor_fit.floor_slope import FloorSlope, floor_slope
from modt.sensor_fit.tilt import find_floor
from modt.types import Float32, Float64, Frame

SAMPLE = 1200
"""Greatest number of points in which the floor is searched."""
LOOK_EVERY = 40
"""Sweeps from one look at the floor to the next while the robot is steady."""
LOOK_SWEEPS = 3
"""Sweeps of a look, in a row: between two of them the turning point of a gait may lie."""
MOVED = np.deg2rad(1.0)
"""Change of a slope from sweep to sweep from which the robot walks or shakes."""
STEADY_SWEEPS = 20
"""Sweeps without such a change after which the robot is steady."""
MEAN_SWEEPS = 20
"""Sweeps over which the mean slope, and the difference between poses and the floor, are averaged."""
MIN_SLOPE = np.deg2rad(2.0)
"""Least mean slope of a steady robot that is corrected; a street slopes to its sides."""
MIN_COMPARED = 5
"""Floors that are compared with poses before the poses tell which floor is one."""
MAX_DISAGREEMENT = np.deg2rad(4.0)
"""Greatest difference between the slopes of a floor and of a pose; a floor beyond it is a wall or a bank."""
NEAREST_M = 0.1
"""Least range of a point that is a return [m]."""
FLAT = 1e-9
"""Slope of a pose that has no roll and pitch."""


class Leveller:
    """Turns sweeps level, by the mount and by what the robot does.

    Args:
        mount: mean attitude of the sensor.
        height_m: height of the sensor above the floor; None if unknown.
        min_range_m: least range of the points that are used.

    Attributes:
        attitude: attitude of the sensor in the last sweep.
    """

    def __init__(self, mount: Mount = LEVEL, height_m: float | None = None, min_range_m: float = 0.0) -> None:
        self.attitude = mount
        self._mount = mount
        self._depth_m = height_m
        self._min_range_m = min_range_m
        self._sweeps = 0
        self._unsteady = 0  # sweeps left until the robot is steady
        self._mean: Float64 = np.zeros(2)  # mean slope while it was not
        self._looks = 0  # floors in that mean
        self._offset: Float64 | None = None  # slope of the poses where the floor is level
        self._compared = 0  # poses in it
        self._last: tuple[Float64 | None, Float64 | None] = None, None  # slopes of floor and pose of the last sweep
        self._last_s = 0.0

    def level(self, frame: Frame) -> Frame:
        """The same sweep in the level frame. The head of a sensor that hangs upside down turns the other way."""
        posed = self._slope_of_pose(frame)
        floor = self._floor(frame, posed) if self._looks_now(posed) else None
        self._notice(floor, posed)
        slope, twist = self._attitude(floor, posed, frame.time_s)
        self._last = None if floor is None else floor.slope, posed
        self._last_s = frame.time_s
        self._sweeps += 1
        self.attitude = self._mount if slope is None else Mount.upright(self._up(slope))
        level = self.attitude.level(frame)
        return level if twist is None or not level.turn_s else untwisted(level, twist)

    def _looks_now(self, posed: Float64 | None) -> bool:
        """Whether the floor of this sweep is searched. Poses tell by themselves whether the robot is steady."""
        if self._unsteady or self._sweeps < LOOK_SWEEPS:
            return True
        return posed is None and self._sweeps % LOOK_EVERY < LOOK_SWEEPS

    def _slope_of_pose(self, frame: Frame) -> Float64 | None:
        """(2,) slope of the plane z = 0 of the world, relative to the mount; None if poses have no roll and pitch."""
        T = frame.T_world_sensor
        if T is None or np.abs(T[2, :2]).max() < FLAT:
            return None
        x, y, z = self._R @ T[2, :3]
        return np.array([x, y]) / z if z > 0.5 else None

    @property
    def _R(self) -> Float64:
        """(3, 3) rotation by the mount."""
        R = self._mount.R_level_sensor
        return np.eye(3) if R is None else R

    def _floor(self, frame: Frame, posed: Float64 | None) -> FloorSlope | None:
        """The floor of a sweep, relative to the mount."""
        if self._depth_m is None:
            found = find_floor(frame.points)
            self._depth_m = found.depth_m if found is not None and found.up @ self._R[2] > 0.5 else None
        if self._depth_m is None:
            return None
        points = frame.points[:: 1 + len(frame.points) // SAMPLE]
        points = points[np.hypot(points[:, 0], points[:, 1]) > max(self._min_range_m, NEAREST_M)]
        level = self._mount.level(replace(frame, points=points))
        xyz = level.points.T[:3].astype(np.float64)
        expected = self._mean if posed is None or self._offset is None else posed - self._offset
        floor = floor_slope(xyz, delays_s(level), expected, self._depth_m)
        if floor is not None and posed is not None and self._compared >= MIN_COMPARED:
            return floor if np.abs(floor.slope - expected).max() < MAX_DISAGREEMENT else None
        return floor

    def _notice(self, floor: FloorSlope | None, posed: Float64 | None) -> None:
        """Notice whether the robot is steady, and average the slopes while it is not."""
        last_floor, last_posed = self._last
        seen = None if floor is None else floor.slope
        pairs = ((seen, last_floor), (posed, last_posed))
        moved = any(now is not None and last is not None and np.abs(now - last).max() > MOVED for now, last in pairs)
        self._unsteady = STEADY_SWEEPS if moved else max(self._unsteady - 1, 0)
        if floor is not None and self._unsteady:
            self._looks += 1
            self._mean = self._mean + (floor.slope - self._mean) / min(self._looks, MEAN_SWEEPS)
        if posed is not None and floor is not None:
            self._compared += 1
            before = posed if self._offset is None else self._offset
            self._offset = before + (posed - floor.slope - before) / min(self._compared, MEAN_SWEEPS)

    def _attitude(
        self, floor: FloorSlope | None, posed: Float64 | None, time_s: float
    ) -> tuple[Float64 | None, Float64 | None]:
        """(2,) slope of the floor relative to the mount, and its (2, 2) twist; None where the mount alone counts."""
        if not self._unsteady:
            return (self._mean, None) if np.abs(self._mean).max() > MIN_SLOPE else (None, None)
        twist = None if floor is None else floor.twist
        if posed is None or self._offset is None:
            return (None if floor is None else floor.slope), twist
        _, last = self._last
        passed_s = time_s - self._last_s
        if twist is None and last is not None and passed_s > 0:
            twist = np.stack([(posed - last) / passed_s, np.zeros(2)])
        return posed - self._offset, twist

    def _up(self, slope: Float64) -> Float64:
        """(3,) upward normal of the floor in the sensor frame, by its slope relative to the mount."""
        up = np.array([slope[0], slope[1], 1.0]) @ self._R
        return np.asarray(up / np.sqrt((up * up).sum()))


def delays_s(frame: Frame) -> Float64:
    """(N,) time after the stamp at which each point was seen [s]."""
    x, y = frame.points.T[:2].astype(np.float64)
    return np.asarray(from_middle(np.arctan2(y, x), frame.mid_rad) * (-frame.turn_s / (2 * np.pi)))


def untwisted(frame: Frame, twist: Float64) -> Frame:
    """A level sweep as if the sensor had not rolled and pitched during it.

    Args:
        frame: the sweep.
        twist: (2, 2) as in FloorSlope.
    """
    points: Float32 = frame.points.copy()
    x, y, z = frame.points.T[:3]
    delay_s = delays_s(frame).astype(np.float32)
    x_twist, y_twist = twist.T.astype(np.float32)
    x_slope = delay_s * (x_twist[0] + delay_s * x_twist[1])
    y_slope = delay_s * (y_twist[0] + delay_s * y_twist[1])
    points[:, 0] -= x_slope * z
    points[:, 1] -= y_slope * z
    points[:, 2] += x_slope * x + y_slope * y
    # A rotation by the arc tangent of the slope keeps the range.
    points[:, :3] /= np.sqrt(1 + np.square(x_slope) + np.square(y_slope))[:, None]
    return replace(frame, points=points)
