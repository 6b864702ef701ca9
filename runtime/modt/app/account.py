"""The account of what was read: how much was used, what was left out and why, and what the points and poses are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from modt.poses.pose_source import PoseSource
from modt.types import DESKEWED, Float64, FrameResult

if TYPE_CHECKING:
    from modt.app.loop import Loop

SEEN_M = 0.1
"""Displacement within a sweep that is worth a line [m]."""
PARTLY = 3
"""Exit status of a replay that could read a part of what was asked for."""


@dataclass(slots=True)
class Travel:
    """Way and time of the sensor over the frames of a run."""

    way_m: float = 0.0
    time_s: float = 0.0
    _last: tuple[float, Float64] | None = field(default=None, repr=False)

    def add(self, result: FrameResult) -> None:
        """Add the way to the place of a frame."""
        time_s = result.frame.time_s
        place = result.T_world_sensor[:3, 3]
        if self._last is not None and time_s > self._last[0]:
            self.way_m += float(np.linalg.norm(place - self._last[1]))
            self.time_s += time_s - self._last[0]
        self._last = (time_s, place)

    @property
    def mean_mps(self) -> float:
        """Mean speed [m/s]."""
        return self.way_m / self.time_s if self.time_s else 0.0


def account(loop: Loop) -> dict[str, Any]:
    """The account of a run so far."""
    reading = loop.source.reading
    poses = loop.stages.odometry
    own = type(poses) is PoseSource
    skewed_m = loop.travel.mean_mps * loop.stages.info.period_s
    return {
        "messages": reading.messages,
        "sweeps": reading.sweeps,
        "used": loop.totals.frames,
        "left_out": dict(loop.source.faults.left_out),
        "joined": reading.joined,
        "deskewed": reading.times[DESKEWED],
        "not_deskewed": {kind: number for kind, number in reading.times.items() if number and kind != DESKEWED},
        "mean_speed_mps": round(loop.travel.mean_mps, 2),
        "shift_in_a_sweep_m": round(skewed_m, 2),
        "corrected": dict(reading.corrected),
        "frame_id": reading.frame_id,
        "without_pose": reading.without_pose if own else 0,
        "alone": dict(reading.alone),
        "poses": (reading.poses or "registration") if own else poses.name,
    }


def closing_lines(read: Mapping[str, Any]) -> list[str]:
    """Lines for the user at the end of a run: what was left out, and what is not deskewed and should be."""
    lines = []
    if read["left_out"]:
        what = "; ".join(f"{number} x {reason}" for reason, number in read["left_out"].items())
        lines.append(f"not all was read: {read['used']} frames of {read['messages']} messages; left out: {what}")
    for sensor, number in read["alone"].items():
        lines.append(f"{number} sweeps of sensor {sensor} have none of another sensor near them: they are used alone")
    if read["without_pose"]:
        lines.append(f"{read['without_pose']} frames have no pose of {read['poses']} near them: they are registered")
    kinds = read["not_deskewed"]
    if kinds and read["shift_in_a_sweep_m"] >= SEEN_M:
        why = ", ".join(kinds)
        speed = f"at {read['mean_speed_mps']:.1f} m/s"
        cost = f"{speed}, things at rest shift by up to {read['shift_in_a_sweep_m']:.2f} m within one"
        lines.append(
            f"{sum(kinds.values())} sweeps are not deskewed ({why}): unless their driver has done so, {cost}"
        )
    return lines
