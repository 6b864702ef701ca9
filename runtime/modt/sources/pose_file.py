"""Poses in KITTI's odometry format: a line a frame, the twelve numbers of a (3, 4) transform, row by row."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import inverse
from modt.types import Float64

NUMBERS = 12
FARTHEST_M = 1e5
"""Places farther from the origin are refused: float32, in which outlines are paired, would lose the centimetres."""
SKEW = 0.01
"""How far R R' of a rotation may be from one: files hold six digits or more."""


def read_poses(path: Path) -> Float64:
    """(n, 4, 4) poses of a file, one a line.

    Raises:
        MisuseError: it cannot be read, holds none, or a line is no pose; it names the line.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise MisuseError(path, f"cannot be read ({error.strerror})", "give a file of poses") from None
    except UnicodeDecodeError:
        raise MisuseError(path, "no text", "give twelve numbers a line") from None
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise MisuseError(path, "no poses", "give twelve numbers a line")
    return np.stack([_pose(line, f"{path}:{number}") for number, line in enumerate(lines, 1)])


def fault(T: Float64) -> str | None:
    """What keeps a (4, 4) matrix from being a pose, None if nothing does."""
    if not np.isfinite(T).all():
        return "not finite"
    if np.abs(T[:3, 3]).max() > FARTHEST_M:
        return f"farther than {FARTHEST_M / 1000:g} km from its origin"
    R = T[:3, :3]
    if np.abs(R).max() > 2 or np.abs(R @ R.T - np.eye(3)).max() > SKEW or np.linalg.det(R) < 0:
        return "no rotation"
    return None


def sensor_poses(T_start_camera: Float64, T_camera_sensor: Float64) -> Float64:
    """(n, 4, 4) T_world_sensor of camera poses (n, 4, 4); the world is the sensor at the camera's start."""
    moved: Float64 = inverse(T_camera_sensor) @ T_start_camera @ T_camera_sensor
    return moved


def _pose(line: str, place: str) -> Float64:
    T = np.eye(4)
    words = line.split()
    if len(words) != NUMBERS:
        raise MisuseError(place, f"{len(words)} numbers, not {NUMBERS}", "write the rows of a 3 x 4 pose")
    try:
        T[:3] = np.array(words, dtype=np.float64).reshape(3, 4)
    except ValueError:
        raise MisuseError(place, "no numbers", "write the rows of a 3 x 4 pose") from None
    wrong = fault(T)
    if wrong:
        raise MisuseError(place, f"{wrong}", "write the rows of a rigid 3 x 4 pose [m]")
    return T
