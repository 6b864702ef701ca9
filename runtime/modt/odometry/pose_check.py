"""Given poses against the scene: what stood still must stand where a pose says."""

from __future__ import annotations

import numpy as np

from modt.geometry import inverse, yaw_of
from modt.geometry.kdop import centres
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations
from modt.odometry.registration import Landmarks
from modt.odometry.tuning import PoseCheckTuning
from modt.types import Float64


class PoseCheck:
    """Whether given poses are believed. Registration places the frames while they are not.

    Doubt begins with a frame whose pose moves the landmarks, while registration brings them back. It ends once the
    poses have moved as registration does for a while; the motion counts, as their origin may have jumped.

    Args:
        kernels: passes over pairs.
        tuning: what agrees, and for how long.

    Attributes:
        doubted: whether poses are not believed.
    """

    def __init__(
        self, kernels: GeometryKernels = NUMPY_GEOMETRY, tuning: PoseCheckTuning = PoseCheckTuning()
    ) -> None:
        self._kernels = kernels
        self._tuning = tuning
        self.doubted = False
        self._began_s = 0.0  # when the doubt began
        # Time, given and registered pose from which the motions are compared
        self._compared_from: tuple[float, Float64, Float64] | None = None
        self._now_s = 0.0

    @property
    def doubted_s(self) -> float:
        """Time for which the poses have been doubted [s]."""
        return self._now_s - self._began_s if self.doubted else 0.0

    def near(self, landmarks: Landmarks, observations: Observations) -> tuple[int, int]:
        """Number of established landmarks, and of those near which something is observed."""
        known = landmarks.established.nonzero()[0]
        if not len(known):
            return 0, 0
        centre = centres(landmarks.kdop.take(known, axis=1))
        seen = centres(observations.kdop)
        widened = np.concatenate([centre, -centre]) + self._tuning.near_m
        pairs = self._kernels.overlapping_pairs(widened, np.concatenate([seen, -seen]))
        return len(known), len(np.unique(pairs[0]))

    def agrees(self, known: int, near: int) -> bool:
        """Whether enough of the landmarks are where the pose says, or too few are known to tell."""
        return known < self._tuning.min_landmarks or near >= self._tuning.agreeing_share * known

    def convinces(self, known: int, near: int, near_registered: int) -> bool:
        """Whether registration explains the frame, and clearly better than the pose."""
        least = max(self._tuning.min_landmarks, self._tuning.convincing_share * known)
        return near_registered >= least and near_registered > self._tuning.better * near

    def begin(self, now_s: float) -> None:
        """Begin to doubt."""
        self.doubted = True
        self._began_s = now_s
        self._now_s = now_s
        self._compared_from = None

    def follow(self, now_s: float, T_given: Float64, T_registered: Float64) -> None:
        """Compare the motions by both poses (4, 4); the doubt ends after some time in which they agree."""
        self._now_s = now_s
        if self._compared_from is None:
            self._compared_from = now_s, T_given, T_registered
        from_s, T_given_before, T_registered_before = self._compared_from
        given = inverse(T_given_before) @ T_given
        difference = inverse(given) @ inverse(T_registered_before) @ T_registered
        far_m = float(np.hypot(difference[0, 3], difference[1, 3]))
        way_m = float(np.hypot(given[0, 3], given[1, 3]))
        if (
            far_m > self._tuning.motion_m + self._tuning.motion_share * way_m
            or abs(yaw_of(difference)) > self._tuning.motion_rad
        ):
            self._compared_from = now_s, T_given, T_registered
        elif now_s - from_s >= self._tuning.agree_s:
            self.doubted = False
