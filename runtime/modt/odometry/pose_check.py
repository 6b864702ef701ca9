"""Given poses against the scene: what stood still must stand where a pose says."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.geometry import inverse, yaw_of
from modt.geometry.kdop import centres, shift_between
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Observations, StaticTracks
from modt.odometry.registration import Landmarks
from modt.odometry.tuning import PoseCheckTuning
from modt.types import Bool, Float64, Int

FIT_ROUNDS = 3
"""Rounds of the fit of a rigid motion; each leaves out the steps that are off by more than twice the median."""


class Anchors(NamedTuple):
    """Places of tracks at rest at a time: their ids (n,), ascending, and k-DOPs (n, 8), and the given pose."""

    time_s: float
    id: Int
    kdop: Float64
    T_world_sensor: Float64


class PoseCheck:
    """Whether given poses are believed. Registration places the frames while they are not.

    Doubt begins with a frame whose pose moves the landmarks, while registration brings them back. Poses that are
    wrong by little a frame carry the landmarks along, so doubt also begins when most of what rested a second ago has
    moved alike. It ends once the poses have moved as registration does for a while; the motion counts, as their
    origin may have jumped.

    Of the methods, `check_drift` is called in each frame that has a pose. While the poses are believed, `count_near`
    serves `agrees` and `convinces`, and `begin` ends the belief. While they are doubted, `follow` is called.

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
        self._anchors: Anchors | None = None
        # Time, given and registered pose from which the motions are compared
        self._compared_from: tuple[float, Float64, Float64] | None = None
        self._now_s = 0.0

    @property
    def doubted_s(self) -> float:
        """Time for which the poses have been doubted [s]."""
        return self._now_s - self._began_s if self.doubted else 0.0

    def count_near(self, landmarks: Landmarks, observations: Observations) -> tuple[int, int]:
        """Number of known landmarks, and of those near which something is observed.

        Known are the established landmarks, or all if few are established. If the poses were wrong from the start,
        nothing rests for long enough to be established.

        Returns:
            n_known and n_near.
        """
        known = landmarks.established.nonzero()[0]
        if len(known) < self._tuning.min_landmarks:
            known = np.arange(len(landmarks.established))
        centre = centres(landmarks.kdop.take(known, axis=1))
        seen = centres(observations.kdop)
        # Bounds (x, y, -x, -y) overlap where an observation is within near_m of a landmark on both axes.
        widened = np.concatenate([centre, -centre]) + self._tuning.near_m
        pairs = self._kernels.overlapping_pairs(widened, np.concatenate([seen, -seen]))
        return len(known), len(np.unique(pairs[0]))

    def agrees(self, n_known: int, n_near: int) -> bool:
        """Whether enough of the landmarks are where the pose says, or too few are known to tell."""
        return n_known < self._tuning.min_landmarks or n_near >= self._tuning.agreeing_share * n_known

    def convinces(
        self, T_given: Float64, T_registered: Float64, n_known: int, n_near: int, n_near_registered: int
    ) -> bool:
        """Whether registration explains the frame by another pose (4, 4), and clearly better than the given one.

        A swaying sensor sees few landmarks in their places by any pose.
        """
        if self._alike(inverse(T_given) @ T_registered, np.eye(4)):
            return False
        least = max(self._tuning.min_landmarks, self._tuning.convincing_share * n_known)
        return n_near_registered >= least and n_near_registered > self._tuning.better * n_near

    def check_drift(self, now_s: float, tracks: StaticTracks, T_world_last: Float64) -> bool:
        """Once in `anchor_s`, whether the tracks at rest moved alike since the anchors; if not, set new anchors.

        After a gap of twice `anchor_s` new anchors are set without a comparison.

        Args:
            now_s: time of this frame [s].
            tracks: tracks after the frame before.
            T_world_last: (4, 4) pose of the frame before.
        """
        anchors = self._anchors
        if anchors is not None and 0 <= now_s - anchors.time_s < self._tuning.anchor_s:
            return False
        if anchors is not None and now_s - anchors.time_s < 2 * self._tuning.anchor_s:
            _, before, now = np.intersect1d(anchors.id, tracks.id, assume_unique=True, return_indices=True)
            seen = tracks.observed[now]
            if self._moved_alike(
                anchors.kdop[before[seen]].T, tracks.kdop[now[seen]].T, anchors.T_world_sensor, T_world_last
            ):
                return True
        rests = tracks.stationary & tracks.observed
        self._anchors = Anchors(now_s, tracks.id[rests], tracks.kdop[rests], T_world_last)
        return False

    def _moved_alike(self, were: Float64, are: Float64, T_before: Float64, T_now: Float64) -> bool:
        """Whether most k-DOPs (8, k) have moved as one body, by more than the errors of the motion between two poses.

        What moved with the sensor is left out, unless nearly all did: the part of a wall that certain rays meet.
        """
        step_m = shift_between(were, are, self._kernels.shape_tuning)
        carried = self._carried(were, step_m, T_now @ inverse(T_before))
        counted = ~carried
        if np.count_nonzero(counted) < self._tuning.min_landmarks:
            counted = np.ones(len(step_m), np.bool_)
        if len(step_m) < self._tuning.min_landmarks:
            return False
        motion = inverse(T_before) @ T_now
        range_m = float(np.median(np.hypot(*(_places(are)[:, counted] - T_now[:2, 3, None]))))
        by_turn_m = self._tuning.turn_share * abs(yaw_of(motion)) * range_m
        rigid_m = _rigid_steps(_places(were)[:, counted], step_m[counted].T)
        far_m = np.hypot(*rigid_m)
        # By wrong poses nearly all of them move as one body. People who were at rest, and crests of hills, do not.
        off_m = np.hypot(*(step_m[counted].T - rigid_m))
        alike = off_m < self._tuning.motion_m / 2 + far_m / 4
        least_m = float(np.sort(far_m)[len(far_m) // 5])
        return alike.mean() >= self._tuning.alike_share and self._exceeds_tolerance(least_m - by_turn_m, motion)

    def _carried(self, were: Float64, step_m: Float64, motion_in_world: Float64) -> Bool:
        """(k,) steps (k, 2) by which k-DOPs (8, k) moved as what is fixed to the sensor does."""
        at = _places(were)
        with_sensor = motion_in_world[:2, :2] @ at + motion_in_world[:2, 3:] - at
        carried: Bool = np.hypot(*(step_m.T - with_sensor)) < self._tuning.motion_m / 2
        return carried

    def _exceeds_tolerance(self, far_m: float, motion: Float64) -> bool:
        """Whether a displacement exceeds `motion_m` and `motion_share` of the way of a motion (4, 4)."""
        way_m = float(np.hypot(motion[0, 3], motion[1, 3]))
        return far_m > self._tuning.motion_m + self._tuning.motion_share * way_m

    def begin(self, now_s: float) -> Int:
        """Begin to doubt.

        Returns:
            Ids (k,) of the tracks that rested at the anchors. Registration holds them as landmarks, since the wrong
            poses have made them seem to move.
        """
        rested = np.zeros(0, np.int64) if self._anchors is None else self._anchors.id
        self.doubted = True
        self._anchors = None
        self._began_s = now_s
        self._now_s = now_s
        self._compared_from = None
        return rested

    def follow(self, now_s: float, T_given: Float64, T_registered: Float64) -> None:
        """Compare the motions by both poses (4, 4); the doubt ends after some time in which they agree."""
        self._now_s = now_s
        if self._compared_from is None:
            self._compared_from = now_s, T_given, T_registered
        from_s, T_given_before, T_registered_before = self._compared_from
        given = inverse(T_given_before) @ T_given
        difference = inverse(given) @ inverse(T_registered_before) @ T_registered
        if not self._alike(difference, given):
            self._compared_from = now_s, T_given, T_registered
        elif now_s - from_s >= self._tuning.agree_s:
            self.doubted = False

    def _alike(self, difference: Float64, motion: Float64) -> bool:
        """Whether the difference (4, 4) of two poses after a motion (4, 4) is within the tolerance."""
        far_m = float(np.hypot(difference[0, 3], difference[1, 3]))
        most_rad = self._tuning.motion_rad + self._tuning.turn_share * abs(yaw_of(motion))
        return not self._exceeds_tolerance(far_m, motion) and abs(yaw_of(difference)) <= most_rad


def _places(kdop: Float64) -> Float64:
    """(2, k) x and y of the middles of k-DOPs (8, k) [m]."""
    x_and_y: Float64 = centres(kdop)[::2]  # the other axes are diagonal
    return x_and_y


def _rigid_steps(at: Float64, step_m: Float64) -> Float64:
    """(2, k) steps of the rigid motion that fits most of the steps (2, k) of places (2, k) [m]; turns are small."""
    x, y = at - at.mean(axis=1, keepdims=True)
    one = np.ones_like(x)
    by_motion = np.array([[one, 0 * x, -y], [0 * x, one, x]])  # axis, part of the motion (along x, y, turn), step
    fits = np.ones(len(x), np.bool_)
    for _ in range(FIT_ROUNDS):
        rows = by_motion[:, :, fits].transpose(0, 2, 1).reshape(-1, 3)
        motion = np.linalg.lstsq(rows, step_m[:, fits].ravel())[0]
        rigid_m: Float64 = np.einsum("apk,p->ak", by_motion, motion)
        off_m = np.hypot(*(step_m - rigid_m))
        fits = off_m <= 2 * np.median(off_m)
    return rigid_m
