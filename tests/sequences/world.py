"""A small world around a robot, whose sensor, clock and odometry may lie."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.types import Float32, Float64, Frame
from tests.segmentation.scans import scan

SENSORS = tuple(
    {"elevation": np.deg2rad(np.linspace(low, high, beams)), "step_deg": step_deg}
    for low, high, beams, step_deg in ((-15, 15, 8, 4.0), (-25, 3, 12, 4.0), (-20, 10, 2, 2.0), (-7, 52, 6, 6.0))
)
ODD = np.array([np.nan, np.inf, -np.inf, 1e-42, -1e-42, 0.0, -0.0, 999.9, -999.9, 3e38, -3e38], np.float32)
"""Values that float32 has and a sensor should not send."""


@dataclass
class World:
    """The surroundings of the robot, and its odometry.

    Attributes:
        stamp_s: time of the next sweep.
        step_s: from a sweep to the next.
        sensor: index in SENSORS.
        posed: whether sweeps come with a pose.
    """

    stamp_s: float = 1000.0
    step_s: float = 0.1
    sensor: int = 0
    posed: bool = True
    restarts: int = 0
    turn_s: float = 0.0
    index: int = 0
    pose: Float64 = field(default_factory=lambda: np.eye(4))
    frames: list[Frame] = field(default_factory=list)

    def sweep(self, seed: int) -> Float32:
        """Points of a floor and some boxes, of which a part moves from sweep to sweep."""
        rng = np.random.default_rng(seed)
        at = rng.uniform(-25, 25, (6, 2)) + self.index * rng.uniform(-1, 1, (6, 2)) * (rng.random((6, 1)) < 0.5)
        sizes = rng.choice([[0.6, 0.6, 1.7], [4.0, 1.8, 1.5], [1.8, 0.6, 1.7], [0.3, 0.3, 2.5]], 6)
        boxes = [(x, y, length, width, 0.0, top) for (x, y), (length, width, top) in zip(at, sizes, strict=True)]
        return scan(boxes, seed=self.index, **SENSORS[self.sensor])[0]

    def frame(self, points: Float32) -> Frame:
        """The next frame, which has these points."""
        pose = self.pose.copy() if self.posed else None
        made = Frame(self.index, self.stamp_s, points, pose, self.restarts, self.turn_s)
        self.index += 1
        self.frames.append(made)
        return made

    def move(self, x_m: float, y_m: float, yaw: float) -> None:
        """Move the robot, by its own account."""
        self.pose = self.pose @ se3(rotation_zyx(yaw, 0.0, 0.0), np.array([x_m, y_m, 0.0]))
        self.pose[:3, 3] = np.clip(self.pose[:3, 3], -9e7, 9e7)  # what the readers of poses let through


def broken(points: Float32, seed: int, share: float) -> Float32:
    """Points of which a share of the values is odd."""
    rng = np.random.default_rng(seed)
    out = points.copy()
    hit = rng.random(out.shape) < share
    out[hit] = rng.choice(ODD, int(hit.sum()))
    return out
