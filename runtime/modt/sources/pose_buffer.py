"""Buffer of the latest poses, with interpolation."""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation

from modt.config import OdometryConfig
from modt.geometry import se3
from modt.types import Float64


class PoseBuffer:
    """The latest poses, ordered by stamp."""

    def __init__(self, config: OdometryConfig) -> None:
        self.config = config
        self._stamps: deque[float] = deque(maxlen=config.capacity)
        self._poses: deque[Float64] = deque(maxlen=config.capacity)

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def newest_s(self) -> float:
        """Stamp of the latest pose [s], minus infinity before the first."""
        return self._stamps[-1] if self._stamps else -np.inf

    def add(self, stamp_s: float, T: Float64) -> bool:
        """Append a (4, 4) pose; False, without effect, if it is not later than the latest."""
        if stamp_s <= self.newest_s:
            return False
        self._stamps.append(stamp_s)
        self._poses.append(T)
        return True

    def speed_to(self, stamp_s: float, T: Float64) -> float:
        """Least speed from the latest pose to a (4, 4) pose, allowing for the noise of positions [m/s]."""
        if stamp_s <= self.newest_s or not self._poses:
            return 0.0
        distance_m = float(np.linalg.norm(T[:3, 3] - self._poses[-1][:3, 3]))
        return max(distance_m - self.config.position_noise_m, 0.0) / (stamp_s - self.newest_s)

    def clear(self) -> None:
        """Remove all poses."""
        self._stamps.clear()
        self._poses.clear()

    def at(self, stamp_s: float) -> Float64 | None:
        """(4, 4) pose at a time, interpolated or extrapolated from the latest poses; None where they are too old."""
        stamps = np.array(self._stamps)
        after = int(np.searchsorted(stamps, stamp_s))
        if after < len(self) and stamps[after] == stamp_s:
            return self._poses[after].copy()
        before = after - 1
        if after == len(self):  # extrapolation over no more than the span of the two poses
            after -= 1
            before = min(int(np.searchsorted(stamps, 2 * self.newest_s - stamp_s, "right")) - 1, after - 1)
            before = max(before, 0)
        if before < 0 or before >= after:
            return None
        t0, t1 = stamps[before], stamps[after]
        if max(abs(stamp_s - t1), min(stamp_s, t1) - t0) > self.config.max_age_s:
            return None
        return interpolate(self._poses[before], self._poses[after], float((stamp_s - t0) / (t1 - t0)))


def interpolate(a: Float64, b: Float64, share: float) -> Float64:
    """(4, 4) pose at a share of the motion from a to b, at constant velocity and turn rate."""
    turn = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).as_rotvec()
    R = a[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return se3(R, a[:3, 3] + share * (b[:3, 3] - a[:3, 3]))
