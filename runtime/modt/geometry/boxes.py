"""Rigid transforms, and upright boxes: x, y, z of the centre, length, width, height [m], yaw [rad]."""

from __future__ import annotations

import math

import numpy as np

from modt.types import Float32, Float64, Int


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
    T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def inverse(T: Float64) -> Float64:
    """(4, 4) inverse of a rigid transform."""
    R = T[:3, :3]
    return se3(R.T, -R.T @ T[:3, 3])


def yaw_of(T: Float64) -> float:
    """Heading of a rigid transform in the ground plane [rad]."""
    return float(np.arctan2(T[1, 0], T[0, 0]))


def quaternion_of(T: Float64) -> Float64:
    """(4,) rotation of a rigid transform as a quaternion x, y, z, w.

    The greatest component is computed first, so that none is divided by a small number.
    """
    R = T[:3, :3]
    diagonal = R.diagonal()
    trace = diagonal.sum()
    i = int(diagonal.argmax())
    j = (i + 1) % 3
    k = (i + 2) % 3
    quaternion = np.empty(4)
    if diagonal[i] > trace:
        quaternion[[i, j, k]] = 1 - trace + 2 * R[i, i], R[j, i] + R[i, j], R[k, i] + R[i, k]
        quaternion[3] = R[k, j] - R[j, k]
    else:
        quaternion[:] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1 + trace
    return quaternion / np.linalg.norm(quaternion)


def rotation_of(quaternion: Float64) -> Float64:
    """(3, 3) rotation by a quaternion x, y, z, w of any length."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), y * y - x * x - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), z * z - x * x - y * y + w * w],
        ]
    )


def turn_between(a: Float64, b: Float64, share: float) -> Float64:
    """(3, 3) rotation of the (4, 4) transform a, turned on towards that of b by a share of the angle between them."""
    *axis, cosine = quaternion_of(inverse(a) @ b).tolist()
    sine = math.copysign(math.hypot(*axis), cosine)
    half_rad = math.atan2(abs(sine), abs(cosine))
    along = math.sin(share * half_rad) / sine if sine else 0.0
    turn = np.array([*(along * component for component in axis), math.cos(share * half_rad)])
    R: Float64 = a[:3, :3] @ rotation_of(turn)
    return R


def transform(T: Float64, xyz: Float64) -> Float64:
    """(n, 3) points taken by the (4, 4) transform."""
    moved: Float64 = xyz @ T[:3, :3].T + T[:3, 3]
    return moved


def transform_boxes(T: Float64, boxes: Float64) -> Float64:
    """(n, 7) boxes taken by the (4, 4) transform; they stay upright."""
    out = boxes.copy()
    out[:, :3] = transform(T, boxes[:, :3])
    out[:, 6] = wrap(boxes[:, 6] + yaw_of(T))
    return out


def upright_boxes(xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
    """(G, 7) boxes at headings or across them, so that l >= w, about groups of points.

    Args:
        xyz: (3, K) points sorted by group [m].
        offsets: (G + 1,) group i owns the columns from offsets[i] to offsets[i + 1]; none is empty.
        yaw: (G,) headings [rad].
    """
    cosine = np.cos(yaw)
    sine = np.sin(yaw)
    starts = offsets[:-1]
    count = offsets[1:] - starts
    c = np.repeat(cosine.astype(np.float32), count)
    s = np.repeat(sine.astype(np.float32), count)
    x, y, z = xyz
    turned_points = (x * c + y * s, y * c - x * s, z)  # along the heading of their group, across it, and upwards
    low = np.stack([np.minimum.reduceat(along, starts) for along in turned_points]).astype(np.float64)
    high = np.stack([np.maximum.reduceat(along, starts) for along in turned_points]).astype(np.float64)
    u, v, z = (low + high) / 2
    length, width, height = high - low
    across = length < width
    columns = [
        u * cosine - v * sine,
        u * sine + v * cosine,
        z,
        np.where(across, width, length),
        np.where(across, length, width),
        height,
        yaw - np.where(across, np.pi / 2, 0.0),
    ]
    return np.stack(columns, axis=1)


def corners(boxes: Float64) -> Float64:
    """(n, 4, 2) bird's-eye corners of (n, 7) boxes, counter-clockwise."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    local = signs * boxes[:, None, 3:5]
    yaw = boxes[:, None, 6]
    c = np.cos(yaw)
    s = np.sin(yaw)
    x = c * local[..., 0] - s * local[..., 1] + boxes[:, None, 0]
    y = s * local[..., 0] + c * local[..., 1] + boxes[:, None, 1]
    return np.stack([x, y], axis=-1)
