"""Angles and rigid transforms."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modt.types import Float64


def wrap(angle: Float64) -> Float64:
    """Angle brought to [-pi, pi) [rad]."""
    wrapped: Float64 = (angle + np.pi) % (2 * np.pi) - np.pi
    return wrapped


def rotation_zyx(roll: float, pitch: float, yaw: float) -> Float64:
    """(3, 3) R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def se3(rotation: Float64, translation: Float64) -> Float64:
    """(4, 4) rigid transform of a (3, 3) rotation and a (3,) translation."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation
    return T


def inverse(T: Float64) -> Float64:
    """(4, 4) inverse of a rigid transform."""
    R = T[:3, :3]
    return se3(R.T, -R.T @ T[:3, 3])


def yaw_of(T: Float64) -> float:
    """Heading of a rigid transform in the ground plane [rad]."""
    return float(np.arctan2(T[1, 0], T[0, 0]))


def quaternion_of(T: Float64) -> Float64:
    """(4,) rotation of a rigid transform as a quaternion x, y, z, w."""
    quaternion: Float64 = Rotation.from_matrix(T[:3, :3]).as_quat()
    return quaternion


def transform(T: Float64, xyz: Float64) -> Float64:
    """(n, 3) points taken by the (4, 4) transform."""
    moved: Float64 = xyz @ T[:3, :3].T + T[:3, 3]
    return moved
