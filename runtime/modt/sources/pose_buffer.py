"""The latest poses by their stamps, interpolated at the time of a frame."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from modt.config import OdometryConfig
from modt.geometry import se3, turn_between
from modt.placement import PlanarMotion
from modt.types import Float64, Frame

CAPACITY = 256
"""Greatest number of poses kept, and of messages read for a frame; the newest remain."""
MAX_AGE_S = 0.3
"""Greatest time between a frame and its poses [s]; a frame beyond it has no pose."""
MAX_ACCELERATION_MPS2 = 10.0
"""Greatest acceleration of the sensor [m/s2]; a pose that needs more is doubted."""
POSITION_NOISE_M = 0.5
"""Distance between two poses that is attributed to noise, not to speed [m]."""
MIN_SPAN_S = 0.02
"""Least time over which the motion of a sensor is taken for that in a sweep [s]."""
_LEVER_M = 5.0
"""Displacement that counts as much as a turn of one radian [m]."""
_UNKNOWN_INTERVAL_S = 0.5
"""Assumed interval between poses until two are known [s]."""


class PoseBuffer:
    """The latest poses, ordered by stamp."""

    def __init__(self, config: OdometryConfig) -> None:
        self.config = config
        self._stamps: deque[float] = deque(maxlen=CAPACITY)
        self._poses: deque[Float64] = deque(maxlen=CAPACITY)

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
        """Reason why a (4, 4) pose does not continue these: repeated, out_of_order, early or leap; None if it does.

        A long gap is a pause of the sender, not a wrong stamp, if the pose is not ahead of the frame at `now_s`.
        """
        if not self._stamps:
            return None
        dt_s = stamp_s - self.newest_s
        if dt_s <= 0:
            return "out_of_order" if dt_s < 0 else "repeated"
        interval_s = self._stamps[-1] - self._stamps[-2] if len(self) > 1 else _UNKNOWN_INTERVAL_S
        ahead_s = min(dt_s, stamp_s - now_s)
        if ahead_s > max(MAX_AGE_S, 2 * interval_s):
            return "early"
        if self.leaps(stamp_s, T):
            return "leap"
        slack_m = POSITION_NOISE_M + MAX_ACCELERATION_MPS2 * dt_s * dt_s
        return "leap" if self.off_m(stamp_s, T) > slack_m else None

    def leaps(self, stamp_s: float, T: Float64) -> bool:
        """Whether a (4, 4) pose is farther from the latest than the sensor can have moved, so of another world."""
        if not self._poses:
            return False
        dt_s = stamp_s - self.newest_s if stamp_s > self.newest_s else MAX_AGE_S
        last = self._poses[-1]
        apart_m = math.dist(T[:3, 3].tolist(), last[:3, 3].tolist()) + _LEVER_M * _turn_rad(last, T)
        return apart_m > POSITION_NOISE_M + self.config.max_speed_mps * dt_s

    def at(self, stamp_s: float) -> Float64 | None:
        """(4, 4) pose at a time, at constant velocity and turn rate; None where the latest poses are too old."""
        ends = self._ends(stamp_s)
        if ends is None:
            return None
        (t0, a), (t1, b) = ends
        if stamp_s == t1:
            return b.copy()
        if max(abs(stamp_s - t1), min(stamp_s, t1) - t0) > MAX_AGE_S:
            return None
        share = (stamp_s - t0) / (t1 - t0)
        T = se3(turn_between(a, b, share), a[:3, 3] + share * (b[:3, 3] - a[:3, 3]))
        return None if stamp_s > t1 and self.leaps(stamp_s, T) else T

    def placed(self, frame: Frame) -> Frame:
        """The frame with its pose, None where the latest poses are too old; its points are moved to its stamp.

        Those of a turning head are moved with their proposals, by the odometry.
        """
        T = self.at(frame.stamp_s)
        placed = replace(frame, T_world_sensor=T)
        if T is None or frame.delay_s is None or not len(frame.points):
            return placed
        before_s = max(float(-frame.delay_s.min()), MIN_SPAN_S)
        T_before = self.at(frame.stamp_s - before_s)
        if T_before is None:
            return placed
        motion = PlanarMotion.between(T_before, T, before_s)
        points = frame.points.copy()
        step_m = motion.displacement(points[:, :2].astype(np.float64), frame.delay_s.astype(np.float64))
        step_m[~np.any(points[:, :3], axis=1)] = 0.0  # no return
        points[:, :2] += step_m
        return replace(placed, points=points, delay_s=None)

    def _ends(self, stamp_s: float) -> list[tuple[float, Float64]] | None:
        """Stamps and poses to interpolate between; both are the same if a pose has this time, None without two.

        After the latest pose they are the latest one and one that lies as far before it as the time lies after it.
        """
        stamps = np.array(self._stamps)
        after = int(np.searchsorted(stamps, stamp_s))
        if after < len(self):
            first = after if stamps[after] == stamp_s else after - 1
        else:
            first = int(np.searchsorted(stamps, 2 * self.newest_s - stamp_s, "right")) - 1
            first = max(first, int(np.searchsorted(stamps, self.newest_s - MAX_AGE_S)))
            after = len(self) - 1
            first = min(first, after - 1)
        return [(self._stamps[k], self._poses[k]) for k in (first, after)] if first >= 0 else None

    def off_m(self, stamp_s: float, T: Float64) -> float:
        """Distance of a (4, 4) pose, later than the latest, from its extrapolation; zero without one [m]."""
        ends = self._ends(stamp_s)
        if ends is None:
            return 0.0
        (t0, a), (t1, b) = ends
        share = (stamp_s - t1) / (t1 - t0)
        off_m = float(np.linalg.norm(T[:3, 3] - b[:3, 3] - share * (b[:3, 3] - a[:3, 3])))
        return off_m + _LEVER_M * max(0.0, _turn_rad(b, T) - share * _turn_rad(a, b))


def _turn_rad(a: Float64, b: Float64) -> float:
    """Angle between two (4, 4) poses."""
    return math.acos(min(max((float(np.sum(a[:3, :3] * b[:3, :3])) - 1) / 2, -1.0), 1.0))
