"""The mount over minutes: a sensor that sags or turns down slowly."""

from __future__ import annotations

import numpy as np

from modt.trust.tuning import MountTuning
from modt.types import Float64


class MountHistory:
    """The normal of the ground, in the sensor frame, against that of the first looks.

    A slope tilts the robot and its sensor alike, so what lasts is the mount.

    Args:
        tuning: when the ground is known, and what lasts.

    Attributes:
        tilt_deg: angle by which the ground has tilted since the start, in the mean of the last looks [deg].
    """

    def __init__(self, tuning: MountTuning) -> None:
        self._tuning = tuning
        self._looks = 0
        self._first = np.zeros(3)  # sum of the normals of the first looks
        self._last = np.zeros(3)  # mean of the normals of the last looks
        self.tilt_deg = 0.0

    def add(self, plane: Float64, R_level_sensor: Float64 | None) -> None:
        """Add the ground of a look.

        Args:
            plane: (3,) the ground z = plane @ (1, x, y), in the level frame.
            R_level_sensor: (3, 3) from the sensor to the level frame, None if it is level.
        """
        normal = np.array([-plane[1], -plane[2], 1.0])
        if R_level_sensor is not None:
            normal = R_level_sensor.T @ normal
        normal /= np.linalg.norm(normal)
        self._looks += 1
        self._last += (normal - self._last) / min(self._looks, self._tuning.memory_looks)
        if self._looks <= self._tuning.first_looks:
            self._first += normal
            return
        cosine = self._first @ self._last / (np.linalg.norm(self._first) * np.linalg.norm(self._last))
        self.tilt_deg = float(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))

    @property
    def is_tilted(self) -> bool:
        """Whether the mount has given way."""
        return self.tilt_deg > self._tuning.tilt_deg
