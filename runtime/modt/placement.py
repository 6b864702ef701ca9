"""Placement of a sweep: mount of the sensor, its pose at the stamp, and its motion during the sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modt.geometry import Camera, inverse, rotation_zyx, se3, yaw_of
from modt.types import Float32, Float64, Frame


@dataclass(frozen=True)
class Mount:
    """Rotation of the sensor on its robot.

    Attributes:
        R_level_sensor: (3, 3) from the sensor to the level frame at its place and heading; None if it is level.
    """

    R_level_sensor: Float64 | None = None

    @classmethod
    def of(cls, roll_deg: float | None, pitch_deg: float | None) -> Mount:
        """A mount by its angles, None for 0."""
        roll, pitch = np.deg2rad([roll_deg or 0.0, pitch_deg or 0.0]).tolist()
        return cls(rotation_zyx(roll, pitch, 0.0) if roll or pitch else None)

    @classmethod
    def upright(cls, up: Float64) -> Mount:
        """The mount of a sensor in whose frame (3,) is the upward unit vector; its heading stays."""
        x, y, z = up.tolist()
        return cls(rotation_zyx(float(np.arctan2(y, z)), float(-np.arcsin(x)), 0.0))

    def turn(self, points: Float32) -> Float32:
        """(N, 4) or wider points in the level frame."""
        if self.R_level_sensor is None:
            return points
        out = points.copy()
        x, y, z = points.T[:3]
        for k, (a, b, c) in enumerate(self.R_level_sensor.astype(np.float32)):
            out[:, k] = a * x + b * y + c * z
        return out

    def level(self, frame: Frame) -> Frame:
        """The same sweep in the level frame. The head of a sensor that hangs upside down turns the other way."""
        R = self.R_level_sensor
        T = frame.T_world_sensor
        if R is None:
            return frame
        pose = None if T is None else T @ inverse(se3(R, np.zeros(3)))
        turn_s = frame.turn_s if R[2, 2] > 0 else -frame.turn_s
        mid = R[:2, 0] * np.cos(frame.mid_rad) + R[:2, 1] * np.sin(frame.mid_rad)
        mid_rad = float(np.arctan2(mid[1], mid[0])) if frame.mid_rad else 0.0
        points = self.turn(frame.points)
        return replace(frame, points=points, T_world_sensor=pose, turn_s=turn_s, mid_rad=mid_rad, R_level_sensor=R)

    def camera(self, camera: Camera) -> Camera:
        """The camera, changed to take points in the level frame instead of the sensor frame."""
        if self.R_level_sensor is None:
            return camera
        T = inverse(se3(self.R_level_sensor, np.zeros(3)))
        return replace(camera, P_image_sensor=camera.P_image_sensor @ T, T_camera_sensor=camera.T_camera_sensor @ T)


LEVEL = Mount()


def mount_pose(position_m: Sequence[float], roll_pitch_yaw_deg: Sequence[float]) -> Float64:
    """(4, 4) pose of a sensor on a robot."""
    return se3(rotation_zyx(*np.deg2rad(roll_pitch_yaw_deg).tolist()), np.array(position_m))


def moved_points(T: Float64, points: Float32) -> Float32:
    """(N, 4) points moved by a (4, 4) transform; those without a return stay at the origin."""
    out = points.copy()
    out[:, :3] = points[:, :3] @ T[:3, :3].T.astype(np.float32) + T[:3, 3].astype(np.float32)
    out[~points[:, :3].any(axis=1), :3] = 0.0
    return out


def joined_points(sweeps: Sequence[Frame | None], T_common: Sequence[Float64]) -> Float32:
    """(N, 4) points of the sweeps, one after the other, moved by the (4, 4) transform of each sensor."""
    moved = [moved_points(T, sweep.points) for sweep, T in zip(sweeps, T_common, strict=True) if sweep is not None]
    return np.concatenate([*moved, np.zeros((0, 4), np.float32)])


@dataclass(frozen=True)
class PlanarMotion:
    """Steady motion of the sensor in the ground plane.

    Attributes:
        velocity_mps: along the sensor's x and y, as a complex number.
        yaw_rate_radps: counter-clockwise.
    """

    velocity_mps: complex = 0j
    yaw_rate_radps: float = 0.0

    @classmethod
    def between(cls, T_world_before: Float64, T_world_after: Float64, dt_s: float) -> PlanarMotion:
        """Motion from one pose to the next; no motion if no time has passed."""
        if dt_s <= 0.0:
            return cls()
        T = T_world_before[:3, :3].T @ T_world_after[:3]
        x, y, _ = T[:, 3] - T_world_before[:3, 3] @ T_world_before[:3, :3]
        yaw = yaw_of(T)
        # The path is an arc: its chord points half the turn away from the initial heading.
        velocity = complex(x, y) * np.exp(-0.5j * yaw) / dt_s
        return cls(velocity, yaw / dt_s)

    def displacement(self, position_m: Float64, delay_s: Float64) -> Float64:
        """(P, 2) displacement of positions (P, 2) [m] from delay_s (P,) after the stamp to the stamp."""
        position = position_m.copy().view(np.complex128)[:, 0]
        half = np.exp(0.5j * self.yaw_rate_radps * delay_s)
        step = position * (half * half - 1.0) + self.velocity_mps * delay_s * half
        xy: Float64 = step.view(np.float64).reshape(-1, 2)
        return xy

    def T_stamp_seen(self, delay_s: float) -> Float64:
        """(4, 4) transform of what was seen delay_s after the stamp to the frame of the sensor at the stamp."""
        yaw = self.yaw_rate_radps * delay_s
        step = self.velocity_mps * delay_s * np.exp(0.5j * yaw)
        return se3(rotation_zyx(0.0, 0.0, yaw), np.array([step.real, step.imag, 0.0]))


def from_middle(bearing: Float64, mid_rad: float) -> Float64:
    """Bearings [rad] relative to the middle of a sweep, from -pi to pi."""
    if not mid_rad:
        return bearing
    relative: Float64 = np.mod(bearing - mid_rad + np.pi, 2 * np.pi) - np.pi
    return relative


def delays(centroid: Float64, box: Float64, turn_s: float, mid_rad: float = 0.0) -> Float64:
    """(P,) time after the stamp at which each proposal was seen [s]; turn_s and mid_rad as in Frame.

    A proposal is moved as a whole, by the time at which its middle was seen. For a body of radius r at distance d two
    errors remain. It turns about itself by at most r times the turn of the sensor in half a sweep. Its ends are seen
    r / (2 pi d) of a sweep before and after its middle (3 cm for a car 10 m away at 10 m/s).

    The time is the mean over the bearings that its box covers. A proposal across the seam is seen at both ends of the
    sweep, and its delay is continuous as its centroid crosses the seam.
    """
    x, y = centroid[:, :2].T
    length, width = box[:, 3:5].T
    bearing = from_middle(np.arctan2(y, x), mid_rad)
    half_angle = np.arctan2(np.hypot(length, width) / 2, np.hypot(x, y))
    beyond_seam = np.maximum(np.abs(bearing) + half_angle - np.pi, 0.0)
    bearing -= np.copysign(np.pi * beyond_seam / np.maximum(half_angle, 1e-9), bearing)
    return np.asarray(bearing * (-turn_s / (2 * np.pi)))


@dataclass(frozen=True)
class Placement:
    """Pose and motion of the sensor in a sweep.

    Attributes:
        T_world_sensor: (4, 4) pose at the stamp.
        motion: motion of the sensor up to the frame.
        turn_s, mid_rad: as in Frame.
    """

    T_world_sensor: Float64
    motion: PlanarMotion = PlanarMotion()
    turn_s: float = 0.0
    mid_rad: float = 0.0

    def deskew(self, position: Float64) -> Float64:
        """(P, 2) correction of positions (P, 2) that the pose at the stamp alone yields [m, world]."""
        R = self.T_world_sensor[:2, :2]
        local = (position - self.T_world_sensor[:2, 3]) @ R
        delay_s = from_middle(np.arctan2(local[:, 1], local[:, 0]), self.mid_rad) * (-self.turn_s / (2 * np.pi))
        step: Float64 = self.motion.displacement(local, delay_s) @ R.T
        return step

    def at_stamp(self, centroid: Float64, box: Float64) -> Float64:
        """(P, 7) boxes in the sensor frame as seen, displaced to where they are at the stamp.

        Args:
            centroid: (P, 3) centroids of their points.
            box: (P, 7) boxes as in Proposals.
        """
        if not self.turn_s:
            return box
        moved = box.copy()
        delay_s = delays(centroid, box, self.turn_s, self.mid_rad)
        moved[:, :2] += self.motion.displacement(np.ascontiguousarray(box[:, :2]), delay_s)
        return moved
