"""Sectors in which the sensor sees the robot that carries it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.types import Bool, Float32


class BlindSectors:
    """Sectors around the sensor.

    Args:
        bounds_deg: from and to of each, counter-clockwise from straight ahead.
        range_m: radius of the sectors.
    """

    def __init__(self, bounds_deg: Sequence[float], range_m: float) -> None:
        self.bounds_deg, self.range_m = np.reshape(np.asarray(bounds_deg, np.float32), (-1, 2)), range_m
        turn = np.diff(self.bounds_deg)[:, 0]
        self.width_deg = np.where(turn >= 360, 360, turn % 360)

    def contain(self, points: Float32) -> Bool:
        """(N,) points that lie in a sector."""
        inside: Bool = np.hypot(points[:, 0], points[:, 1]) < self.range_m
        near = np.flatnonzero(inside)
        azimuth_deg = np.rad2deg(np.arctan2(points[near, 1], points[near, 0]))[:, None]
        inside[near] = ((azimuth_deg - self.bounds_deg[:, 0]) % 360 <= self.width_deg).any(axis=1)
        return inside
