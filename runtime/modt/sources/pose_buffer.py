"""Buffer of the latest poses, with interpolation."""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation

from modt.config import OdometryConfig
from modt.geometry import se3
from modt.types import Float64

_LEVER_M = 5.0
"""Distance that a turn of one radian counts as."""
_UNKNOWN_INTERVAL_S = 0.5


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

    @property
    def span_s(self) -> float:
        """Time from the earliest to the latest pose [s]."""
        return self._stamps[-1] - self._stamps[0] if self._stamps else 0.0

    def add(self, stamp_s: float, T: Float64) -> None:
        """Append a (4, 4) pose, later than the latest."""
        self._stamps.append(stamp_s)
        self._poses.append(T)

    def doubt(self, stamp_s: float, T: Float64, now_s: float) -> str | None:
        """Why a (4, 4) pose does not continue these: repeated, out_of_order, early or leap; None if it does.

        A gap before it is one of the sender's, not a wrong stamp, if it is not ahead of now_s, the time of the frame.
        """
        if not self._stamps:
            return None
        dt_s = stamp_s - self.newest_s
        if dt_s <= 0:
            return "out_of_order" if dt_s < 0 else "repeated"
        interval_s = self._stamps[-1] - self._stamps[-2] if len(self) > 1 else _UNKNOWN_INTERVAL_S
        ahead_s = min(dt_s, stamp_s - now_s)
        if ahead_s > max(self.config.max_age_s, 2 * interval_s):
            return "early"
        if self.leaps(stamp_s, T):
            return "leap"
        expected = self._line(stamp_s)
        slack_m = self.config.position_noise_m + self.config.max_acceleration_mps2 * dt_s**2
        return "leap" if expected is not None and _apart_m(expected[0], T) > slack_m else None

    def leaps(self, stamp_s: float, T: Float64) -> bool:
        """Whether a (4, 4) pose is farther from the latest than its sensor can have moved: it is of another world."""
        if not self._poses:
            return False
        dt_s = stamp_s - self.newest_s if stamp_s > self.newest_s else self.config.max_age_s
        return _apart_m(self._poses[-1], T) > self.config.position_noise_m + self.config.max_speed_mps * dt_s

    def clear(self) -> None:
        """Remove all poses."""
        self._stamps.clear()
        self._poses.clear()

    def at(self, stamp_s: float) -> Float64 | None:
        """(4, 4) pose at a time, interpolated or extrapolated from the latest poses; None where they are too old."""
        line = self._line(stamp_s)
        return line[0] if line is not None and line[1] <= self.config.max_age_s else None

    def _line(self, stamp_s: float) -> tuple[Float64, float] | None:
        """(4, 4) pose at a time on the line through two poses, and the distance in time that they bridge [s]."""
        stamps = np.array(self._stamps)
        after = int(np.searchsorted(stamps, stamp_s))
        if after < len(self) and stamps[after] == stamp_s:
            return self._poses[after].copy(), 0.0
        before = after - 1
        if after == len(self):  # extrapolation over no more than the span of the two poses
            after -= 1
            before = int(np.searchsorted(stamps, 2 * self.newest_s - stamp_s, "right")) - 1
            before = max(before, int(np.searchsorted(stamps, self.newest_s - self.config.max_age_s)))
            before = min(before, after - 1)
        if before < 0 or before >= after:
            return None
        t0, t1 = stamps[before], stamps[after]
        T = interpolate(self._poses[before], self._poses[after], float((stamp_s - t0) / (t1 - t0)))
        return T, float(max(abs(stamp_s - t1), min(stamp_s, t1) - t0))


def _apart_m(a: Float64, b: Float64) -> float:
    """Distance between two (4, 4) poses, turns included [m]."""
    cosine = (np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]) + _LEVER_M * np.arccos(np.clip(cosine, -1.0, 1.0)))


def interpolate(a: Float64, b: Float64, share: float) -> Float64:
    """(4, 4) pose at a share of the motion from a to b, at constant velocity and turn rate."""
    turn = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).as_rotvec()
    R = a[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return se3(R, a[:3, 3] + share * (b[:3, 3] - a[:3, 3]))
