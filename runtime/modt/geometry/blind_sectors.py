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

    def contain(self, points: Float32) -> Bool:
        """(N,) points that lie in a sector."""
        inside: Bool = np.hypot(points[:, 0], points[:, 1]) < self.range_m
        near = np.flatnonzero(inside)
        azimuth_deg = np.rad2deg(np.arctan2(points[near, 1], points[near, 0]))[:, None]
        first, last = self.bounds_deg.T
        inside[near] = ((azimuth_deg - first) % 360 <= (last - first) % 360).any(axis=1)
        return inside
