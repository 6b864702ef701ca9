"""Sources of the poses of a stream."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from modt.errors import MisuseError
from modt.geometry import Camera
from modt.sources.stream import StreamInfo
from modt.types import Frame


class PoseSource:
    """Sets the poses of frames; the poses of the recording by default."""

    name = "recording"
    has_poses: bool | None = None
    """Whether a stream with these poses has poses; None: as without them."""

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """Properties of a stream with these poses."""
        return info if self.has_poses is None else replace(info, has_poses=self.has_poses, pose_notes=())

    def place(self, frame: Frame) -> Frame:
        """The frame with its pose, None where unknown; frames come in order."""
        return frame

    def report(self) -> dict[str, Any]:
        """Name of the source, and statistics."""
        return {"source": self.name}

    def close(self) -> None:
        """Release what the source holds."""


class RecordedPoses(PoseSource):
    """The poses of the recording."""


class NoPoses(PoseSource):
    """No poses: ego-motion is estimated from the proposals."""

    name, has_poses = "none", False

    def place(self, frame: Frame) -> Frame:
        """Without a pose."""
        return replace(frame, T_world_sensor=None)


class PoseFile(PoseSource):
    """Poses of a file in KITTI's odometry format: line k, from 0, belongs to frame k.

    The poses are the camera's (KITTI's rectified left one), without one the sensor's; `end` is the index of the last
    frame plus one, None where unknown.

    Raises:
        MisuseError: the file is missing, a line is no pose, or there are too few.
    """

    has_poses = True

    def __init__(self, path: Path, camera: Camera | None, end: int | None) -> None:
        from modt.sources.pose_file import read_poses, sensor_poses

        self.name = str(path)
        poses = read_poses(path)
        self._poses = poses if camera is None else sensor_poses(poses, camera.T_camera_sensor)
        if end is not None:
            self._require(end - 1)

    def place(self, frame: Frame) -> Frame:
        """The frame with the pose of its index.

        Raises:
            MisuseError: there are too few.
        """
        self._require(frame.index)
        return replace(frame, T_world_sensor=self._poses[frame.index])

    def _require(self, frame: int) -> None:
        if frame >= len(self._poses):
            cause = f"{len(self._poses)} poses, too few for frame {frame}"
            raise MisuseError(self.name, cause, "give a line for every frame from 0 on, or fewer --frames")
