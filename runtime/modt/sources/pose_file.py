"""Files of poses in KITTI's odometry format.

A line holds the twelve elements of the (3, 4) transform of a frame, row by row.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import inverse
from modt.sources.text_file import read_text
from modt.types import Float64

N_ELEMENTS = 12
MAX_DISTANCE_M = 1e8
"""Greatest coordinate of a pose [m]. Those of any frame fixed to the Earth are smaller."""
MAX_SKEW = 0.01
"""Greatest element of R R' - I of a rotation; files hold at least six digits."""


def read_poses(path: Path) -> Float64:
    """(n, 4, 4) poses of a file, one per line.

    Raises:
        MisuseError: the file is unreadable or empty, or a line is no pose; the error names the line.
    """
    lines = read_text(path, "give a file of poses").rstrip().splitlines()
    if not lines:
        raise MisuseError(path, "no poses", "give twelve numbers a line")
    return np.stack([_pose(line, f"{path}:{number}") for number, line in enumerate(lines, 1)])


def pose_defect(T: Float64) -> str | None:
    """Reason why a (4, 4) matrix is no pose, None if it is one."""
    if not np.isfinite(T).all():
        return "not finite"
    if np.abs(T[:3, 3]).max() > MAX_DISTANCE_M:
        return f"farther than {MAX_DISTANCE_M / 1000:g} km from its origin"
    R = T[:3, :3]
    if np.abs(R).max() > 2 or np.abs(R @ R.T - np.eye(3)).max() > MAX_SKEW or np.linalg.det(R) < 0:
        return "no rotation"
    return None


def sensor_poses(T_start_camera: Float64, T_camera_sensor: Float64) -> Float64:
    """(n, 4, 4) T_world_sensor of camera poses (n, 4, 4); the world is the frame of the sensor at the start."""
    return np.asarray(inverse(T_camera_sensor) @ T_start_camera @ T_camera_sensor)


def _pose(line: str, location: str) -> Float64:
    remedy = "write the rows of a 3 x 4 pose"
    numbers = line.split()
    T = np.eye(4)
    if len(numbers) != N_ELEMENTS:
        raise MisuseError(location, f"{len(numbers)} numbers, not {N_ELEMENTS}", remedy)
    try:
        T[:3] = np.array(numbers, dtype=np.float64).reshape(3, 4)
    except ValueError:
        raise MisuseError(location, "no numbers", remedy) from None
    if defect := pose_defect(T):
        raise MisuseError(location, defect, "write the rows of a rigid 3 x 4 pose [m]")
    return T
