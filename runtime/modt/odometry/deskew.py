"""What a turning head does to a sweep: a sensor that moves sees each bearing from elsewhere.

A proposal is moved as a whole, by the time at which its middle was seen. What that leaves of a body of radius r at a
distance d: its own turn, at most r times what the sensor turns in half a sweep (5 cm for a car behind another that
turns at 30 degrees a second, half of it abeam, nothing ahead), and the times of its ends, which are r / (2 pi d) of a
sweep off that of its middle (3 cm for a car 10 m away at 10 m/s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import yaw_of
from modt.types import Float64, Proposals

LEVER_M, ALIKE_M = 20.0, 0.05
"""Within so many metres motions that displace nothing by more are as good as one another."""


@dataclass(frozen=True, slots=True)
class Motion:
    """How a sensor moves in the plane, steadily.

    Attributes:
        velocity_mps: along its own x and y, as a complex number.
        turn_radps: counter-clockwise.
    """

    velocity_mps: complex = 0j
    turn_radps: float = 0.0

    @classmethod
    def between(cls, T_world_before: Float64, T_world_after: Float64, dt_s: float) -> Motion:
        """The one that led from pose to pose; none where no time passed."""
        if dt_s <= 0.0:
            return cls()
        T = T_world_before[:3, :3].T @ T_world_after[:3]
        x, y, _ = T[:, 3] - T_world_before[:3, 3] @ T_world_before[:3, :3]
        turn = yaw_of(T)
        # The way is an arc: its chord points half the turn away from where it began.
        velocity = complex(x, y) * np.exp(-0.5j * turn) / dt_s
        return cls(velocity, turn / dt_s)

    def skews_like(self, other: Motion, turn_s: float) -> bool:
        """Whether sweeps of such turns (Frame.turn_s) are skewed alike by both, up to LEVER_M away."""
        faster = abs(self.velocity_mps - other.velocity_mps) + LEVER_M * abs(self.turn_radps - other.turn_radps)
        return bool(faster * abs(turn_s) / 2 <= ALIKE_M)

    def displacement(self, place_m: Float64, delay_s: Float64) -> Float64:
        """(P, 2) steps of what was seen at a place (P, 2) so late (P,) to where it is seen from at the stamp [m]."""
        position = place_m[:, 0] + 1j * place_m[:, 1]
        half = np.exp(0.5j * self.turn_radps * delay_s)
        step = position * (half * half - 1.0) + self.velocity_mps * delay_s * half
        xy: Float64 = step.view(np.float64).reshape(-1, 2)
        return xy


@dataclass(frozen=True, slots=True)
class SweepSkew:
    """Where and when the proposals of a frame were seen; P rows.

    Attributes:
        place: (P, 2) their centroids [m, sensor frame at that time].
        delay_s: (P,) after the stamp.
    """

    position: Float64
    delay_s: Float64

    @classmethod
    def of(cls, proposals: Proposals, turn_s: float) -> SweepSkew | None:
        """That of a head that turns so (Frame.turn_s); none if all was seen at once."""
        return cls(proposals.centroid[:, :2], delays(proposals, turn_s)) if turn_s else None

    def step(self, motion: Motion, T_world_sensor: Float64) -> Float64:
        """(P, 2) from where the pose at the stamp puts them to where they stand [m, world]."""
        step: Float64 = motion.displacement(self.position, self.delay_s) @ T_world_sensor[:2, :2].T
        return step

    def share(self, dt_s: float) -> Float64:
        """(P,) part of a correction of the pose, dt_s after the one before, by which what was seen then moves.

        A sensor that went farther in that time had gone farther by the same share whenever it saw something.
        """
        share: Float64 = 1.0 + self.delay_s / dt_s
        return share


@dataclass(frozen=True, slots=True)
class Placement:
    """By what a frame was placed.

    Attributes:
        T_world_sensor: (4, 4) pose at the stamp.
        motion: of the sensor up to it.
        turn_s: as in Frame.
    """

    T_world_sensor: Float64
    motion: Motion = Motion()
    turn_s: float = 0.0

    def step(self, position: Float64) -> Float64:
        """(P, 2) from where the pose puts what is seen about a place (P, 2) to where that stands [m, world]."""
        R, t = self.T_world_sensor[:2, :2], self.T_world_sensor[:2, 3]
        local = (position - t) @ R
        delay_s = np.arctan2(local[:, 1], local[:, 0]) * (-self.turn_s / (2 * np.pi))
        step: Float64 = self.motion.displacement(local, delay_s) @ R.T
        return step


def delays(proposals: Proposals, turn_s: float) -> Float64:
    """(P,) when each proposal was seen, after the stamp of its frame [s]; turn_s as in Frame.

    It is the mean over the bearings that its box takes up: what lies across the seam is seen at both ends of the
    sweep, and does not leap by a whole one as its centroid crosses.
    """
    (x, y), (length, width) = proposals.centroid[:, :2].T, proposals.box[:, 3:5].T
    bearing = np.arctan2(y, x)
    wide = np.arctan2(np.hypot(length, width) / 2, np.hypot(x, y))
    across = np.maximum(np.abs(bearing) + wide - np.pi, 0.0)
    bearing -= np.copysign(np.pi * across / np.maximum(wide, 1e-9), bearing)
    late: Float64 = bearing * (-turn_s / (2 * np.pi))
    return late
