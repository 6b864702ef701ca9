"""The field of view: the camera that bounds it, and the sectors in which the sensor sees its robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from modt.types import Bool, Float32, Float64

Real = TypeVar("Real", np.float32, np.float64)


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
        """View between the left and the right edge of a camera's image."""
        u, _, w = camera.P_image_sensor
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


class BlindSectors:
    """Sectors around the sensor.

    Args:
        bounds_deg: from and to of each, counter-clockwise from straight ahead.
        range_m: radius of the sectors.
    """

    def __init__(self, bounds_deg: Sequence[float], range_m: float) -> None:
        self._from_deg, to_deg = np.reshape(np.asarray(bounds_deg, np.float32), (-1, 2)).T
        turn_deg = to_deg - self._from_deg
        self._width_deg = np.where(turn_deg >= 360, 360, turn_deg % 360)
        self._range_m = range_m

    def contain(self, points: Float32) -> Bool:
        """(N,) points that lie in a sector."""
        inside: Bool = np.hypot(points[:, 0], points[:, 1]) < self._range_m
        near = np.flatnonzero(inside)
        azimuth_deg = np.rad2deg(np.arctan2(points[near, 1], points[near, 0]))[:, None]
        inside[near] = ((azimuth_deg - self._from_deg) % 360 <= self._width_deg).any(axis=1)
        return inside
