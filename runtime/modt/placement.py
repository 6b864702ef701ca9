"""Placement of a sweep: mount of the sensor, its pose at the stamp, and its motion during the sweep."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modt.geometry import Camera, inverse, rotation_zyx, se3, yaw_of
from modt.types import Float32, Float64, Frame


@dataclass(frozen=True, slots=True)
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
        return replace(frame, points=self.turn(frame.points), T_world_sensor=pose, turn_s=turn_s, R_level_sensor=R)

    def camera(self, camera: Camera) -> Camera:
        """The camera, changed to take points in the level frame instead of the sensor frame."""
        if self.R_level_sensor is None:
            return camera
        T = inverse(se3(self.R_level_sensor, np.zeros(3)))
        return replace(camera, P_image_sensor=camera.P_image_sensor @ T, T_camera_sensor=camera.T_camera_sensor @ T)


LEVEL = Mount()


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class Placement:
    """Pose and motion of the sensor in a sweep.

    Attributes:
        T_world_sensor: (4, 4) pose at the stamp.
        motion: motion of the sensor up to the frame.
        turn_s: as in Frame.
    """

    T_world_sensor: Float64
    motion: PlanarMotion = PlanarMotion()
    turn_s: float = 0.0

    def deskew(self, position: Float64) -> Float64:
        """(P, 2) correction of positions (P, 2) that the pose at the stamp alone yields [m, world]."""
        R = self.T_world_sensor[:2, :2]
        local = (position - self.T_world_sensor[:2, 3]) @ R
        delay_s = np.arctan2(local[:, 1], local[:, 0]) * (-self.turn_s / (2 * np.pi))
        step: Float64 = self.motion.displacement(local, delay_s) @ R.T
        return step
