"""Received poses: interpolation at the time of a frame, and rejection of wrong ones."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from modt.config import OdometryConfig
from modt.geometry import se3, turn_between
from modt.types import Float64

CAPACITY = 256
"""Greatest number of poses kept, and of messages read for a frame; the newest remain."""
MAX_AGE_S = 0.3
"""Greatest time between a frame and its poses [s]; a frame beyond it has no pose."""
MAX_ACCELERATION_MPS2 = 10.0
"""Greatest acceleration of the sensor [m/s2]; a pose that needs more is doubted."""
POSITION_NOISE_M = 0.5
"""Distance between two poses that is attributed to noise, not to speed [m]."""
CONFIRM_S = 0.2
"""Time for which doubted poses must be mutually consistent to be believed [s]."""
_LEVER_M = 5.0
"""Distance that stands for a turn of one radian [m]."""
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
        return "leap" if self._off_m(stamp_s, T) > slack_m else None

    def leaps(self, stamp_s: float, T: Float64) -> bool:
        """Whether a (4, 4) pose is farther from the latest than the sensor can have moved, so of another world."""
        if not self._poses:
            return False
        dt_s = stamp_s - self.newest_s if stamp_s > self.newest_s else MAX_AGE_S
        last = self._poses[-1]
        apart_m = float(np.linalg.norm(T[:3, 3] - last[:3, 3])) + _LEVER_M * _turn_rad(last, T)
        return apart_m > POSITION_NOISE_M + self.config.max_speed_mps * dt_s

    def clear(self) -> None:
        """Remove all poses."""
        self._stamps.clear()
        self._poses.clear()

    def at(self, stamp_s: float) -> Float64 | None:
        """(4, 4) pose at a time, interpolated or extrapolated from the latest poses; None where they are too old."""
        ends = self._ends(stamp_s)
        if ends is None:
            return None
        (t0, a), (t1, b) = ((self._stamps[k], self._poses[k]) for k in ends)
        if stamp_s == t1:
            return b.copy()
        if max(abs(stamp_s - t1), min(stamp_s, t1) - t0) > MAX_AGE_S:
            return None
        T = interpolate(a, b, (stamp_s - t0) / (t1 - t0))
        return None if stamp_s > t1 and self.leaps(stamp_s, T) else T

    def _ends(self, stamp_s: float) -> tuple[int, int] | None:
        """Indices of the two poses to interpolate; twice the same one if it has this time.

        After the latest pose they are the latest and one as long before it as the time is behind it.
        """
        stamps = np.array(self._stamps)
        after = int(np.searchsorted(stamps, stamp_s))
        if after < len(self):
            first = after if stamps[after] == stamp_s else after - 1
            return (first, after) if first >= 0 else None
        before = int(np.searchsorted(stamps, 2 * self.newest_s - stamp_s, "right")) - 1
        before = max(before, int(np.searchsorted(stamps, self.newest_s - MAX_AGE_S)))
        before = min(before, len(self) - 2)
        return (before, len(self) - 1) if before >= 0 else None

    def _off_m(self, stamp_s: float, T: Float64) -> float:
        """Distance of a (4, 4) pose, later than the latest, from its extrapolation; zero without one [m]."""
        ends = self._ends(stamp_s)
        if ends is None:
            return 0.0
        (t0, a), (t1, b) = ((self._stamps[k], self._poses[k]) for k in ends)
        share = (stamp_s - t1) / (t1 - t0)
        off_m = float(np.linalg.norm(T[:3, 3] - b[:3, 3] - share * (b[:3, 3] - a[:3, 3])))
        return off_m + _LEVER_M * max(0.0, _turn_rad(b, T) - share * _turn_rad(a, b))


def _turn_rad(a: Float64, b: Float64) -> float:
    """Angle between two (4, 4) poses."""
    return math.acos(min(max((float(np.sum(a[:3, :3] * b[:3, :3])) - 1) / 2, -1.0), 1.0))


def interpolate(a: Float64, b: Float64, share: float) -> Float64:
    """(4, 4) pose at a share of the motion from a to b, at constant velocity and turn rate."""
    return se3(turn_between(a, b, share), a[:3, 3] + share * (b[:3, 3] - a[:3, 3]))


_MIN_VOTES = 5
"""Number of votes after which a doubted sequence replaces the old one."""


class PoseSequence:
    """Poses that are mutually consistent; single inconsistent ones are doubted.

    Mutually consistent doubted poses form a sequence of their own. A pose that continues it votes for it, any other
    pose votes against it. After _MIN_VOTES votes over CONFIRM_S the new sequence replaces the old one: the sender has
    set its clock or, after a leap, restarted with another world.

    Attributes:
        believed: poses of the current sequence.
        restarts: number of sequences that took over with a leap.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self.config = config
        self.restarts = 0
        self.clear()

    def clear(self) -> None:
        """Remove all poses; the next one is believed."""
        self.believed, self._doubted, self._votes = PoseBuffer(self.config), PoseBuffer(self.config), 0

    def add(self, stamp_s: float, T: Float64, now_s: float) -> str | None:
        """Add a (4, 4) pose received before the frame at `now_s`; the reason of a doubt, None if it is believed."""
        doubt = self.believed.doubt(stamp_s, T, now_s)
        if doubt is None:
            self.believed.add(stamp_s, T)
            self._vote_against()
        elif doubt != "repeated":
            self._consider(stamp_s, T, now_s)
            if self._votes >= _MIN_VOTES and self._doubted.span_s >= CONFIRM_S:
                self.restarts += self.believed.leaps(stamp_s, T)
                self.believed, self._doubted, self._votes = self._doubted, PoseBuffer(self.config), 0
                return None
        return doubt

    def _consider(self, stamp_s: float, T: Float64, now_s: float) -> None:
        doubt = self._doubted.doubt(stamp_s, T, now_s)
        if doubt not in (None, "repeated"):
            self._vote_against()
            doubt = self._doubted.doubt(stamp_s, T, now_s)
        if doubt is None:
            self._doubted.add(stamp_s, T)
            self._votes += 1

    def _vote_against(self) -> None:
        self._votes = max(0, self._votes - 1)
        if not self._votes:
            self._doubted.clear()
