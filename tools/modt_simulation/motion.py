"""Motion of bodies along polylines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modt.types import Float64


@dataclass(frozen=True)
class Path:
    """A polyline and the distance travelled along it over time."""

    xy: Float64  # (n, 2) way points [m, world]; one for a body at rest
    time_s: Float64  # (k,) ascending times
    travelled_m: Float64  # (k,) distance along the line at these times; constant before and after
    heading_rad: float = 0.0  # heading of a body at rest

    @classmethod
    def standing(cls, x: float, y: float, heading_rad: float) -> Path:
        """The path of a body at rest."""
        return cls(np.array([[x, y]]), np.zeros(1), np.zeros(1), heading_rad)

    @classmethod
    def steady(cls, xy: ArrayLike, start_m: float, speed_mps: float, seconds: float) -> Path:
        """The path of a body at constant speed from start_m along the line."""
        time = np.array([0.0, seconds])
        return cls(np.asarray(xy), time, start_m + speed_mps * time)

    @property
    def at_rest(self) -> bool:
        """Whether the body never moves."""
        return len(self.xy) == 1

    @cached_property
    def _segments(self) -> tuple[Float64, Float64, Float64]:
        """Distance along the line of the way points and of the middle of each segment [m], its heading [rad]."""
        step = np.diff(self.xy, axis=0)
        length = np.linalg.norm(step, axis=1)
        along = np.append(0.0, np.cumsum(length))
        heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        return along, along[:-1] + length / 2, heading

    def at(self, time_s: float) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] at a time."""
        if self.at_rest:
            return float(self.xy[0, 0]), float(self.xy[0, 1]), self.heading_rad
        along, middle, heading = self._segments
        s = np.interp(time_s, self.time_s, self.travelled_m)
        x, y = (float(np.interp(s, along, column)) for column in self.xy.T)
        return x, y, float(np.interp(s, middle, heading))

    def speed(self, time_s: float) -> float:
        """Speed at a time [m/s], over 0.1 s."""
        if self.at_rest:
            return 0.0
        travelled = np.interp([time_s - 0.05, time_s + 0.05], self.time_s, self.travelled_m)
        along, *_ = self._segments
        return float(np.ptp(np.clip(travelled, 0.0, along[-1])) / 0.1)


def timetable(seconds: float, speed_mps: Float64, start_m: float = 0.0) -> tuple[Float64, Float64]:
    """Times [s] and distances travelled [m] of speeds at equal steps over a duration."""
    time = np.linspace(0.0, seconds, len(speed_mps))
    step = np.diff(time) * (speed_mps[1:] + speed_mps[:-1]) / 2
    return time, start_m + np.append(0.0, np.cumsum(step))
