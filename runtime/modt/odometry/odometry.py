"""The odometry stage: the pose of every sweep, and its proposals in the world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modt.geometry import inverse, se3
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Located, Observations, StaticTracks, observe
from modt.odometry.registration import LandmarkMap, Registration
from modt.placement import Placement, PlanarMotion
from modt.types import Float64, Frame, Proposals


def delays(proposals: Proposals, turn_s: float) -> Float64:
    """(P,) time after the stamp at which each proposal was seen [s]; turn_s as in Frame.

    A proposal is moved as a whole, by the time at which its middle was seen. For a body of radius r at distance d two
    errors remain. It turns about itself by at most r times the turn of the sensor in half a sweep. Its ends are seen
    r / (2 pi d) of a sweep before and after its middle (3 cm for a car 10 m away at 10 m/s).

    The time is the mean over the bearings that its box covers. A proposal across the seam is seen at both ends of the
    sweep, and its delay is continuous as its centroid crosses the seam.
    """
    (x, y), (length, width) = proposals.centroid[:, :2].T, proposals.box[:, 3:5].T
    bearing = np.arctan2(y, x)
    half_angle = np.arctan2(np.hypot(length, width) / 2, np.hypot(x, y))
    beyond_seam = np.maximum(np.abs(bearing) + half_angle - np.pi, 0.0)
    bearing -= np.copysign(np.pi * beyond_seam / np.maximum(half_angle, 1e-9), bearing)
    return np.asarray(bearing * (-turn_s / (2 * np.pi)))


FAR_M = 1e5
"""Greatest coordinate of a first pose [m] whose world is kept. Beyond it float32, which the association uses, is
coarser than a centimetre, so the world has its origin at the position of that pose."""
_RANGE_M, _TOLERANCE_M = 20.0, 0.05
"""A sweep is registered a second time if the first registration moves a position within this range by more [m]."""


class Odometry:
    """Places sweeps by their poses, or, where a sweep has none, by registration against stationary tracks.

    Args:
        kernels: passes over points and pairs.
    """

    def __init__(self, kernels: GeometryKernels = NUMPY_GEOMETRY) -> None:
        self._kernels = kernels
        self._registration = Registration(kernels)
        self._landmarks = LandmarkMap()
        self._time_s: float | None = None
        self._before = self._last = Placement(np.eye(4))
        self._T_world_odometry: Float64 | None = None
        self._restarts = 0

    def adopt(self, other: Odometry) -> None:
        """Continue in the world of another odometry, at its last pose."""
        self._landmarks.clear()
        self._time_s, self._before, self._last = other._time_s, other._before, other._last
        self._T_world_odometry, self._restarts = other._T_world_odometry, other._restarts

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """Placement of a frame, and its proposals in the world.

        Args:
            frame: sweep; its pose, if any, is in the world of an odometry that may restart (Frame.restarts).
            proposals: proposals of the frame.
            static_tracks: function of a time that returns the tracks that a frame may continue. It is called if the
                frame has no pose.
        """
        given, first = frame.T_world_sensor, self._time_s is None
        if frame.restarts != self._restarts:
            self._restarts, self._T_world_odometry = frame.restarts, None
        if first and given is not None:
            far = np.abs(given[:3, 3]).max() > FAR_M
            self._T_world_odometry = se3(np.eye(3), -given[:3, 3] if far else np.zeros(3))
            self._last = Placement(self._T_world_odometry @ given)
        delay_s = delays(proposals, frame.turn_s) if frame.turn_s else None
        dt_s = 0.0 if self._time_s is None else frame.time_s - self._time_s
        if 2 * dt_s < abs(frame.turn_s):  # the errors of the poses would be extrapolated, so no motion is assumed
            dt_s = np.inf
        before = self._last.T_world_sensor

        def placed(T_world_sensor: Float64) -> Placement:
            return Placement(T_world_sensor, PlanarMotion.between(before, T_world_sensor, dt_s), frame.turn_s)

        def observed(placement: Placement) -> Observations:
            observations = observe(proposals, placement.T_world_sensor, self._kernels)
            if delay_s is not None and not first:
                step = placement.motion.displacement(proposals.centroid[:, :2], delay_s)
                observations.move(step @ placement.T_world_sensor[:2, :2].T)
            return observations

        if given is not None and self._T_world_odometry is not None:
            self._landmarks.clear()
            placement = placed(self._T_world_odometry @ given)
        else:
            landmarks = self._landmarks.update(static_tracks(frame.time_s))
            share = 1.0 if delay_s is None else 1.0 + delay_s / dt_s  # share of a correction at the time of view

            def registered(placement: Placement) -> Placement:
                correction = self._registration.correct(landmarks, observed(placement), share)
                return placed(_rigid(correction @ placement.T_world_sensor))

            predicted = placed(before @ (inverse(self._before.T_world_sensor) @ before))  # the last motion continues
            placement = registered(predicted)
            a, b = placement.motion, predicted.motion
            faster_mps = abs(a.velocity_mps - b.velocity_mps) + _RANGE_M * abs(a.yaw_rate_radps - b.yaw_rate_radps)
            if delay_s is not None and faster_mps * abs(frame.turn_s) / 2 > _TOLERANCE_M:
                placement = registered(placement)
            if given is not None:  # an odometry that begins late or restarts is aligned with the world of the tracks
                self._T_world_odometry = placement.T_world_sensor @ inverse(given)
        self._before, self._last, self._time_s = self._last, placement, frame.time_s
        return Located(placement, observed(placement))


def _rigid(T: Float64) -> Float64:
    """(4, 4) nearest rigid transform, as products of transforms drift from being rigid."""
    U, _, Vt = np.linalg.svd(T[:3, :3])
    return se3(U @ Vt, T[:3, 3])
