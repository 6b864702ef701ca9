"""How bodies move: along lines through way points, at speeds that change gently."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.types import Float64


@dataclass(frozen=True)
class Path:
    """A line through the plane and a timetable.

    Attributes:
        xy: (n, 2) way points [m, world]; one for a body that stays where it is.
        time_s, travelled_m: (k,) timetable: distance along the line over time, ascending; beyond its ends the body
            stands still.
        heading_rad: of a body that has one way point only.
    """

    xy: Float64
    time_s: Float64
    travelled_m: Float64
    heading_rad: float = 0.0

    def __post_init__(self) -> None:
        if len(self.xy) > 1:
            step = np.diff(self.xy, axis=0)
            length = np.linalg.norm(step, axis=1)
            yaw = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
            object.__setattr__(self, "_along", np.append(0.0, np.cumsum(length)))
            object.__setattr__(self, "_middle", np.append(0.0, np.cumsum(length))[:-1] + length / 2)
            object.__setattr__(self, "_yaw", yaw)

    @classmethod
    def standing(cls, x: float, y: float, heading_rad: float) -> Path:
        """A body that does not move."""
        return cls(np.array([[x, y]]), np.zeros(1), np.zeros(1), heading_rad)

    @classmethod
    def steady(cls, xy: Float64, start_m: float, speed_mps: float, seconds: float) -> Path:
        """A body that follows the line at one speed from start_m on."""
        time = np.array([0.0, seconds])
        return cls(xy, time, start_m + speed_mps * time)

    def at(self, time_s: float) -> tuple[float, float, float]:
        """x, y [m] and heading [rad] at a time."""
        if len(self.xy) == 1:
            return float(self.xy[0, 0]), float(self.xy[0, 1]), self.heading_rad
        along: Float64 = self._along  # type: ignore[attr-defined]
        s = float(np.interp(time_s, self.time_s, self.travelled_m))
        x = float(np.interp(s, along, self.xy[:, 0]))
        y = float(np.interp(s, along, self.xy[:, 1]))
        return x, y, float(np.interp(s, self._middle, self._yaw))  # type: ignore[attr-defined]

    def speed(self, time_s: float) -> float:
        """Speed [m/s] at a time."""
        if len(self.xy) == 1:
            return 0.0
        travelled = np.interp([time_s - 0.05, time_s + 0.05], self.time_s, self.travelled_m)
        s0, s1 = np.clip(travelled, 0.0, self._along[-1])  # type: ignore[attr-defined]
        return float(abs(s1 - s0) / 0.1)


def timetable(seconds: float, speed_mps: Float64, start_m: float = 0.0) -> tuple[Float64, Float64]:
    """Times and distances of speeds given at equal steps over a duration."""
    time = np.linspace(0.0, seconds, len(speed_mps))
    step = np.diff(time) * (speed_mps[1:] + speed_mps[:-1]) / 2
    return time, start_m + np.append(0.0, np.cumsum(step))
