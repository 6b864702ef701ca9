"""The newest poses of a sensor, and where it was between them."""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation

from modt.geometry import se3
from modt.types import Float64

NOISE_M = 0.5
"""Poses close together in time may be this far apart whatever the speed."""


class PoseRing:
    """Poses in the order of their stamps, the oldest making room.

    Args:
        capacity: poses kept.
        max_age_s: a pose says nothing about times farther from it than this [s].
    """

    def __init__(self, capacity: int, max_age_s: float) -> None:
        self.max_age_s = max_age_s
        self._stamps: deque[float] = deque(maxlen=capacity)
        self._poses: deque[Float64] = deque(maxlen=capacity)

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def newest_s(self) -> float:
        """Stamp of the newest pose [s], minus infinity before any."""
        return self._stamps[-1] if self._stamps else -np.inf

    def add(self, stamp_s: float, T: Float64) -> bool:
        """Keep a (4, 4) pose; False, and not kept, if it is no newer than the newest."""
        if stamp_s <= self.newest_s:
            return False
        self._stamps.append(stamp_s)
        self._poses.append(T)
        return True

    def speed_to(self, stamp_s: float, T: Float64) -> float:
        """Speed at which the sensor came to a (4, 4) pose from the newest one, not counting noise [m/s]."""
        if stamp_s <= self.newest_s or not self._poses:
            return 0.0
        way_m = float(np.linalg.norm(T[:3, 3] - self._poses[-1][:3, 3]))
        return max(way_m - NOISE_M, 0.0) / (stamp_s - self.newest_s)

    def clear(self) -> None:
        """Forget all poses."""
        self._stamps.clear()
        self._poses.clear()

    def at(self, stamp_s: float) -> Float64 | None:
        """(4, 4) pose at a time: between the two around it, or on from the last ones; None where they are too old."""
        stamps = np.array(self._stamps)
        after = int(np.searchsorted(stamps, stamp_s))
        if after < len(self) and stamps[after] == stamp_s:
            return self._poses[after].copy()
        before = after - 1
        if after == len(self):  # on from the newest, no farther than back to what it is extrapolated from
            after -= 1
            before = min(int(np.searchsorted(stamps, 2 * self.newest_s - stamp_s, "right")) - 1, after - 1)
            before = max(before, 0)
        if before < 0 or before >= after:
            return None
        t0, t1 = stamps[before], stamps[after]
        if max(abs(stamp_s - t1), min(stamp_s, t1) - t0) > self.max_age_s:
            return None
        return between(self._poses[before], self._poses[after], float((stamp_s - t0) / (t1 - t0)))


def between(a: Float64, b: Float64, share: float) -> Float64:
    """(4, 4) pose a share of the way from a to b: straight, and turning at one rate; beyond them outside 0 to 1."""
    turn = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).as_rotvec()
    R = a[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return se3(R, a[:3, 3] + share * (b[:3, 3] - a[:3, 3]))
