"""Poses that leap, as when a localisation corrects itself: an event, not a motion of the sensor."""

from __future__ import annotations

import logging
from dataclasses import replace

from modt.config import OdometryConfig
from modt.sources.pose_buffer import MAX_ACCELERATION_MPS2, PoseBuffer
from modt.types import Frame

log = logging.getLogger(__name__)

LEAST_M = 0.2
"""Deviation of a pose from the motion of the frames before that no sensor shows by itself [m]."""
NOISE_FACTOR = 5.0
"""Deviations up to this multiple of the usual one are noise."""
LATEST_WEIGHT = 0.1
"""Weight of the latest deviation in the usual one."""


class LeapWatch:
    """Compares the pose of each frame with the motion of the frames before.

    After a leap the frames are in a new world, which the odometry joins to that of the tracks by what stands still.

    Attributes:
        leaps: number of leaps so far.
    """

    def __init__(self) -> None:
        self.leaps = 0
        self._poses = PoseBuffer(OdometryConfig())
        self._usual_m = 0.0

    def watched(self, frame: Frame, name: str) -> Frame:
        """The frame, with the leaps so far among its restarts; `name` is the subject of the log."""
        T = frame.T_world_sensor
        dt_s = frame.time_s - self._poses.newest_s
        if T is not None and dt_s > 0:
            off_m = self._poses.off_m(frame.time_s, T)
            if off_m > LEAST_M + MAX_ACCELERATION_MPS2 * dt_s * dt_s + NOISE_FACTOR * self._usual_m:
                self._note(off_m, frame, name)
                self._poses = PoseBuffer(OdometryConfig())
            else:
                self._usual_m += LATEST_WEIGHT * (off_m - self._usual_m)
            self._poses.add(frame.time_s, T)
        return replace(frame, restarts=frame.restarts + self.leaps)

    def _note(self, off_m: float, frame: Frame, name: str) -> None:
        if not self.leaps:
            cause = "a localisation that corrects itself? tracks keep their positions; later ones are only counted"
            log.warning("%s: the pose leaps by %.1f m at frame %d: %s", name, off_m, frame.index, cause)
        self.leaps += 1
