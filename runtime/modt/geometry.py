"""SE(3), angles, boxes and the field of view."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from modt.types import Bool, Float64, Int

Real = TypeVar("Real", np.float32, np.float64)


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


def upright_box(xyz: Float64, yaw: float) -> Float64:
    """(7,) x, y, z of the centre, l >= w, h [m], yaw [rad] of the box about (3, n) points, at a heading or across."""
    c, s = np.cos(yaw), np.sin(yaw)
    sides = np.stack([xyz[0] * c + xyz[1] * s, xyz[1] * c - xyz[0] * s, xyz[2]])
    low, high = sides.min(axis=1), sides.max(axis=1)
    (u, v, w), (length, width, tall) = (low + high) / 2, high - low
    if length < width:
        length, width, yaw = width, length, yaw - np.pi / 2
    return np.array([u * c - v * s, u * s + v * c, w, length, width, tall, yaw])


def boxes_about(boxes: Float64, group: Int, yaw: Float64) -> Float64:
    """(U, 7) boxes, l >= w, about groups of boxes (F, 7); group (F,) ascends.

    Args:
        boxes: (F, 7) those to hold.
        group: (F,) which of the U each is in.
        yaw: (U,) heading of each, or across it [rad].
    """
    begins, own = group.searchsorted(np.arange(len(yaw))), yaw[group]
    x, y, z, length, width, height, heading = boxes.T
    c, s, along, across = np.cos(own), np.sin(own), np.abs(np.cos(heading - own)), np.abs(np.sin(heading - own))
    middle = np.array((x * c + y * s, y * c - x * s, z))
    half = np.array((length * along + width * across, length * across + width * along, height)) / 2
    low = np.minimum.reduceat(middle - half, begins, axis=1)
    high = np.maximum.reduceat(middle + half, begins, axis=1)
    (u, v, w), (length, width, height) = (low + high) / 2, high - low
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.where(length < width, np.pi / 2, 0.0)
    sides = np.maximum(length, width), np.minimum(length, width)
    return np.array((u * c - v * s, u * s + v * c, w, *sides, height, yaw - turn)).T


def corners(boxes: Float64) -> Float64:
    """(n, 4, 2) bird's-eye corners of (n, 7) boxes, counter-clockwise."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    local = signs * boxes[:, None, 3:5]
    c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    x = c * local[..., 0] - s * local[..., 1] + boxes[:, None, 0]
    y = s * local[..., 0] + c * local[..., 1] + boxes[:, None, 1]
    return np.stack([x, y], axis=-1)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera beside the sensor.

    Attributes:
        P_image_sensor: (3, 4) projection of sensor coordinates into the rectified image.
        T_camera_sensor: (4, 4) sensor to rectified camera coordinates (x right, y down, z forward).
        width_px, height_px: size of the image.
    """

    P_image_sensor: Float64
    T_camera_sensor: Float64
    width_px: float
    height_px: float


@dataclass(frozen=True)
class FieldOfView:
    """The part of space that is looked at: where every plane's signed distance is positive.

    Attributes:
        planes: (F, 4) unit normal and offset of each bounding plane, sensor frame; none for the full circle.
    """

    planes: Float64 = field(default_factory=lambda: np.zeros((0, 4)))

    @classmethod
    def of_camera(cls, camera: Camera) -> FieldOfView:
        """What lies between the left and the right edge of a camera's image."""
        u, w = camera.P_image_sensor[0], camera.P_image_sensor[2]
        planes = np.stack([u, camera.width_px * w - u])
        return cls(planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True))

    @property
    def full(self) -> bool:
        """Whether nothing is cut off."""
        return len(self.planes) == 0

    def depth(self, points: NDArray[Real]) -> NDArray[Real]:
        """(n,) distance of (n, 3 or more) points to the nearest bounding plane [m], negative outside.

        It is infinite everywhere for the full circle.
        """
        nearest = np.full(len(points), np.inf, points.dtype)
        normals = np.zeros((len(self.planes), points.shape[1]), points.dtype)
        normals[:, :3] = self.planes[:, :3]
        for normal, offset in zip(normals, self.planes[:, 3].tolist(), strict=True):  # two planes, not points
            np.minimum(nearest, points @ normal + points.dtype.type(offset), out=nearest)
        return nearest

    def contains(self, points: NDArray[Real]) -> Bool:
        """(n,) whether each of (n, 3 or more) points lies inside."""
        inside: Bool = self.depth(points) > 0
        return inside
