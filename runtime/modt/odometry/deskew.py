"""Deskew of a sweep taken by a turning head: a moving sensor sees each bearing from another position.

A proposal is moved as a whole, by the time at which its middle was seen. The remaining error of a body of radius r at
distance d: its own rotation, at most r times what the sensor turns in half a sweep, and the delays of its ends, which
differ by r / (2 pi d) of a sweep from that of its middle (3 cm for a car 10 m away at 10 m/s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.placement import PlanarMotion
from modt.types import Float64, Proposals


@dataclass(frozen=True, slots=True)
class SweepSkew:
    """Where and when the proposals of a frame were seen; P rows.

    Attributes:
        position: (P, 2) their centroids [m, sensor frame at that time].
        delay_s: (P,) after the stamp.
    """

    position: Float64
    delay_s: Float64

    @classmethod
    def of(cls, proposals: Proposals, turn_s: float) -> SweepSkew | None:
        """Skew of a head that turns once in turn_s (Frame.turn_s); None for a sweep without skew."""
        return cls(proposals.centroid[:, :2], delays(proposals, turn_s)) if turn_s else None

    def step(self, motion: PlanarMotion, T_world_sensor: Float64) -> Float64:
        """(P, 2) from where the pose at the stamp puts them to where they are at the stamp [m, world]."""
        step: Float64 = motion.displacement(self.position, self.delay_s) @ T_world_sensor[:2, :2].T
        return step

    def share(self, dt_s: float) -> Float64:
        """(P,) share of a correction of the pose, dt_s after the pose before, that applies at the time of view."""
        share: Float64 = 1.0 + self.delay_s / dt_s
        return share


def skews_alike(a: PlanarMotion, b: PlanarMotion, turn_s: float, range_m: float, tolerance_m: float) -> bool:
    """Whether two motions displace nothing within a range by more than a tolerance from one another."""
    faster = abs(a.velocity_mps - b.velocity_mps) + range_m * abs(a.yaw_rate_radps - b.yaw_rate_radps)
    return bool(faster * abs(turn_s) / 2 <= tolerance_m)


def delays(proposals: Proposals, turn_s: float) -> Float64:
    """(P,) time after the stamp at which each proposal was seen [s]; turn_s as in Frame.

    The mean over the bearings that its box covers: a proposal across the seam is seen at both ends of the sweep, and
    its delay is continuous as its centroid crosses the seam.
    """
    (x, y), (length, width) = proposals.centroid[:, :2].T, proposals.box[:, 3:5].T
    bearing = np.arctan2(y, x)
    half_angle = np.arctan2(np.hypot(length, width) / 2, np.hypot(x, y))
    beyond_seam = np.maximum(np.abs(bearing) + half_angle - np.pi, 0.0)
    bearing -= np.copysign(np.pi * beyond_seam / np.maximum(half_angle, 1e-9), bearing)
    delay_s: Float64 = bearing * (-turn_s / (2 * np.pi))
    return delay_s
