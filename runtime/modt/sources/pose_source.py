"""Sources of the poses of a stream, and files of poses.

A file is in KITTI's odometry format: per frame a line of the twelve elements of a (3, 4) transform, row-major.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera, inverse
from modt.sources.stream import StreamInfo
from modt.sources.text_file import read_text
from modt.types import Float64, Frame

N_ELEMENTS = 12
MAX_DISTANCE_M = 1e8
"""Greatest coordinate of a pose [m]. Those of any frame fixed to the Earth are smaller."""
MAX_SKEW = 0.01
"""Greatest element of R R' - I of a rotation; files hold at least six digits."""


class PoseSource:
    """Sets the poses of frames; by default those of the recording stay."""

    name = "recording"
    has_poses: bool | None = None
    """Whether a stream with these poses has poses; None keeps the property of the stream."""

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """Properties of a stream with these poses."""
        return info if self.has_poses is None else replace(info, has_poses=self.has_poses, pose_notes=())

    def place(self, frame: Frame) -> Frame:
        """Return the frame with its pose, None where unknown; frames come in order."""
        return frame

    def report(self) -> dict[str, Any]:
        """Name of the source, and statistics."""
        return {"source": self.name}

    def close(self) -> None:
        """Release the resources of the source."""


class NoPoses(PoseSource):
    """Removes poses, so that ego-motion is estimated from the proposals."""

    name = "none"
    has_poses = False

    def place(self, frame: Frame) -> Frame:
        """Return the frame without a pose."""
        return replace(frame, T_world_sensor=None)


class PoseFile(PoseSource):
    """Poses of a file; line k, from 0, belongs to frame k.

    The poses are those of KITTI's rectified left camera, or of the sensor where `camera` is None; `end` is the index
    of the last frame plus one, None where unknown.

    Raises:
        MisuseError: the file is missing, a line is no pose, or there are too few.
    """

    has_poses = True

    def __init__(self, path: Path, camera: Camera | None, end: int | None) -> None:
        self.name = str(path)
        poses = read_poses(path)
        self._poses = poses if camera is None else sensor_poses(poses, camera.T_camera_sensor)
        if end is not None:
            self._require(end - 1)

    def place(self, frame: Frame) -> Frame:
        """Return the frame with the pose of its index.

        Raises:
            MisuseError: the file has too few poses.
        """
        self._require(frame.index)
        return replace(frame, T_world_sensor=self._poses[frame.index])

    def _require(self, frame: int) -> None:
        if frame >= len(self._poses):
            cause = f"{len(self._poses)} poses, too few for frame {frame}"
            raise MisuseError(self.name, cause, "give a line for every frame from 0 on, or fewer --frames")


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
