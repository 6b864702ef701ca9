"""The odometry stage: the pose of every sweep, and its proposals in the world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modt.geometry import inverse, rotation_zyx, se3, yaw_of
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Located, Observations, StaticTracks, observe
from modt.odometry.pose_check import PoseCheck
from modt.odometry.registration import LandmarkMap, Landmarks, Registration
from modt.odometry.tuning import OdometryTuning
from modt.placement import Placement, PlanarMotion, delays
from modt.types import Float64, Frame, Proposals

FAR_M = 1e5
"""Greatest coordinate of a first pose [m] whose world is kept; farther away, the world has its origin at the position
of that pose. Positions are in double precision, but pairs of k-DOPs are compared in single precision first, whose
step is 8 mm at this coordinate and half a metre at a northing of 5000 km. The coarser it is, the more pairs that do
not overlap are compared a second time, in double precision."""
_INITIAL_TURNS = sorted(range(-8, 9), key=abs)
"""Turns that are tried while no motion is known, in steps of RegistrationTuning.initial_turn_rad."""


class PoseEstimator:
    """Places sweeps by poses that can be believed, others by registration against stationary tracks.

    Registration begins at a prediction: the sensor moves as it did between the two frames before. Frames are taken to
    be equally far apart in time; a frame left out makes the prediction wrong by the motion in its time.

    Args:
        kernels: passes over points and pairs.
        tuning: thresholds and scales of the odometry.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY, tuning: OdometryTuning = OdometryTuning()) -> None:
        self._kernels = kernels
        self._tuning = tuning
        self._registration = Registration(kernels, tuning.registration)
        self._landmarks = LandmarkMap(tuning.landmarks)
        self.pose_check = PoseCheck(kernels, tuning.pose_check)
        self._time_s: float | None = None
        self._T_world_before = np.eye(4)  # pose two frames ago
        self._T_world_last = np.eye(4)  # pose one frame ago
        self._T_world_odometry: Float64 | None = None
        self._posed = False  # whether the last frame had a pose
        self._restarts = 0

    def adopt(self, other: PoseEstimator) -> None:
        """Continue in the world of another estimator, at its last pose.

        Landmarks are forgotten. The state of this estimator's registration stays: whether a motion was known, and the
        inliers of the last fit.
        """
        self._landmarks.clear()
        self._time_s = other._time_s
        self._T_world_before = other._T_world_before
        self._T_world_last = other._T_world_last
        self._T_world_odometry = other._T_world_odometry
        self._restarts = other._restarts

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """Place a frame and its proposals in the world.

        Args:
            frame: sweep; its pose, if any, is in the world of an odometry that may restart (Frame.restarts).
            proposals: proposals of the frame.
            static_tracks: function of a time that returns the tracks that a frame may continue, and forgets the
                expired ones.
        """
        # The world of a frame's pose is that of its odometry, which begins anew with each restart.
        T_odometry_sensor = frame.T_world_sensor
        if frame.restarts != self._restarts:
            self._restarts = frame.restarts
            self._T_world_odometry = None
        if self._time_s is None and T_odometry_sensor is not None:
            self._begin(T_odometry_sensor)
        sweep = self._sweep(frame, proposals)
        if T_odometry_sensor is None and self._posed:
            self._landmarks.clear()  # a drift of the poses before does not snap back
        self._posed = T_odometry_sensor is not None
        tracks = static_tracks(frame.time_s)
        landmarks = self._landmarks.update(tracks)
        if T_odometry_sensor is not None and self._T_world_odometry is not None:
            drifted = self.pose_check.check_drift(frame.time_s, tracks, self._T_world_last)
            located = self._checked(frame.time_s, sweep, landmarks, T_odometry_sensor, drifted=drifted)
        else:
            placement = self._register(sweep, landmarks)
            if T_odometry_sensor is not None:  # an odometry that begins late or restarts is aligned with the world
                self._T_world_odometry = _aligned(placement.T_world_sensor, T_odometry_sensor)
            located = Located(placement, sweep.observe(placement))
        placement = located.placement
        self._T_world_before = self._T_world_last
        self._T_world_last = placement.T_world_sensor
        self._time_s = frame.time_s
        return located

    def _checked(
        self, now_s: float, sweep: _Sweep, landmarks: Landmarks, T_odometry_sensor: Float64, *, drifted: bool
    ) -> Located:
        """The sweep by its pose, or by registration while the poses are doubted."""
        check = self.pose_check
        assert self._T_world_odometry is not None
        if check.doubted:
            placement = self._register(sweep, landmarks)
            check.follow(now_s, T_odometry_sensor, placement.T_world_sensor)
            if not check.doubted:  # where the poses began to be right again is not known, so they are aligned anew
                self._T_world_odometry = _aligned(placement.T_world_sensor, T_odometry_sensor)
            return Located(placement, sweep.observe(placement))
        given_placement = sweep.place(self._T_world_odometry @ T_odometry_sensor)
        located = Located(given_placement, sweep.observe(given_placement))
        n_known, n_near = check.count_near(landmarks, located.observations)
        if check.agrees(n_known, n_near) and not drifted:
            return located
        placement = self._register(sweep, landmarks)
        registered = Located(placement, sweep.observe(placement))
        _, n_near_registered = check.count_near(landmarks, registered.observations)
        poses = given_placement.T_world_sensor, placement.T_world_sensor
        if not drifted and not check.convinces(*poses, n_known, n_near, n_near_registered):
            return located
        self._landmarks.hold(check.begin(now_s))
        return registered

    def _begin(self, T_odometry_sensor: Float64) -> None:
        """Start the world at the odometry's own origin, or at the first pose's position if that is beyond FAR_M."""
        position = T_odometry_sensor[:3, 3]
        far = np.abs(position).max() > FAR_M
        self._T_world_odometry = se3(np.eye(3), -position if far else np.zeros(3))
        self._T_world_last = self._T_world_odometry @ T_odometry_sensor

    def _sweep(self, frame: Frame, proposals: Proposals) -> _Sweep:
        """The frame after the last one, to be placed."""
        first = self._time_s is None
        dt_s = 0.0 if self._time_s is None else frame.time_s - self._time_s
        if 2 * dt_s < abs(frame.turn_s):
            # Motion over less than half the sweep would extrapolate the errors of the poses, so none is assumed: any
            # displacement over an infinite time is a velocity of zero.
            dt_s = np.inf
        delay_s = None
        if not first and frame.turn_s:
            delay_s = delays(proposals.centroid, proposals.box, frame.turn_s, frame.mid_rad)
        elif not first and frame.delay_s is not None:
            delay_s = np.add.reduceat(frame.delay_s[proposals.members], proposals.offsets[:-1], dtype=np.float64)
            delay_s /= proposals.count
        return _Sweep(proposals, self._T_world_last, dt_s, frame.turn_s, delay_s, self._kernels, frame.mid_rad)

    def _register(self, sweep: _Sweep, landmarks: Landmarks) -> Placement:
        """Placement of a sweep without a pose, by stationary objects."""
        # Registration corrects the prediction in the plane only, so a pitch or a climb that went on would never end.
        T_world_last = _planar(self._T_world_last)
        if self._registration.initialised:  # the motion between the last two frames goes on, by the same displacement
            motion = inverse(_planar(self._T_world_before)) @ T_world_last
            motion[2, 3] = 0.0
        else:
            motion = self._initial_turn(sweep, landmarks, T_world_last)
            sweep = replace(sweep, delay_s=None)
        predicted = sweep.place(T_world_last @ motion)
        placement = self._corrected(predicted, sweep, landmarks)
        change_m = sweep.deskewed_change_m(predicted, placement, self._tuning.repeat_range_m)
        if change_m > self._tuning.repeat_tolerance_m:
            placement = self._corrected(placement, sweep, landmarks)
        return placement

    def _initial_turn(self, sweep: _Sweep, landmarks: Landmarks, T_world_last: Float64) -> Float64:
        """(4, 4) turn since the last sweep by which most proposals agree with landmarks, while no motion is known.

        What a sensor that turns on the spot sees is twisted alike in each sweep, so the sweeps are compared as seen.
        """
        as_seen = replace(sweep, delay_s=None)
        best = np.eye(4)
        most_inliers = 0
        for k in _INITIAL_TURNS:
            turn = se3(rotation_zyx(0.0, 0.0, k * self._tuning.registration.initial_turn_rad), np.zeros(3))
            fit = self._registration.support(landmarks, as_seen.observe(as_seen.place(T_world_last @ turn)))
            if fit.inliers > most_inliers:
                most_inliers = fit.inliers
                best = turn
            if fit.supported(self._tuning.registration.inlier_ratio):
                break
        return best

    def _corrected(self, placement: Placement, sweep: _Sweep, landmarks: Landmarks) -> Placement:
        """A placement of a sweep, corrected by one registration."""
        correction = self._registration.correct(landmarks, sweep.observe(placement), sweep.correction_share())
        return sweep.place(_rigid(correction @ placement.T_world_sensor))


@dataclass(frozen=True)
class _Sweep:
    """A sweep that is placed by a pose on trial.

    Attributes:
        proposals: proposals of the sweep.
        T_world_last: (4, 4) pose of the sweep before.
        dt_s: time since then [s]; infinite if no motion is to be assumed.
        turn_s: as in Frame.
        delay_s: (P,) time after the stamp at which each proposal was seen; None if all were seen at the stamp.
        kernels: passes over points.
        mid_rad: as in Frame.
    """

    proposals: Proposals
    T_world_last: Float64
    dt_s: float
    turn_s: float
    delay_s: Float64 | None
    kernels: GeometryKernels
    mid_rad: float

    def place(self, T_world_sensor: Float64) -> Placement:
        """Placement by a pose, with the motion that leads to it."""
        motion = PlanarMotion.between(self.T_world_last, T_world_sensor, self.dt_s)
        return Placement(T_world_sensor, motion, self.turn_s, self.mid_rad)

    def observe(self, placement: Placement) -> Observations:
        """The proposals in the world, where they are at the stamp."""
        observations = observe(self.proposals, placement.T_world_sensor, self.kernels)
        if self.delay_s is not None:
            step = placement.motion.displacement(self.proposals.centroid[:, :2], self.delay_s)
            observations = observations.moved(step @ placement.T_world_sensor[:2, :2].T)
        return observations

    def correction_share(self) -> Float64 | float:
        """(P,) share of a correction of the pose that applies at the time of view of each proposal.

        A correction scales the motion since the last sweep, so a proposal seen later gets more of it.
        """
        return 1.0 if self.delay_s is None else 1.0 + self.delay_s / self.dt_s

    def deskewed_change_m(self, one: Placement, other: Placement, range_m: float) -> float:
        """Greatest difference of the deskewed positions at a range [m] by two placements."""
        if self.delay_s is None:
            return 0.0
        a = one.motion
        b = other.motion
        difference_mps = abs(b.velocity_mps - a.velocity_mps) + range_m * abs(b.yaw_rate_radps - a.yaw_rate_radps)
        return difference_mps * abs(self.turn_s) / 2


def _planar(T: Float64) -> Float64:
    """(4, 4) pose at the same place and with the same heading that is level."""
    return se3(rotation_zyx(0.0, 0.0, yaw_of(T)), T[:3, 3])


def _aligned(T_world_sensor: Float64, T_odometry_sensor: Float64) -> Float64:
    """(4, 4) T_world_odometry, a turn about the vertical and a shift that give two poses one place and heading."""
    return _planar(T_world_sensor) @ inverse(_planar(T_odometry_sensor))


def _rigid(T: Float64) -> Float64:
    """(4, 4) nearest rigid transform, as products of transforms drift from being rigid."""
    U, _, Vt = np.linalg.svd(T[:3, :3])
    return se3(U @ Vt, T[:3, 3])
