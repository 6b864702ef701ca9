"""Poses of the frames of a stream, by default those of the recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from modt.errors import MisuseError
from modt.geometry import Camera
from modt.poses.leap_watch import LeapWatch
from modt.sources.stream import StreamInfo
from modt.types import Frame


class PoseSource:
    """Sets the poses of frames; by default those of the recording stay."""

    name = "recording"

    def __init__(self) -> None:
        self.watch = LeapWatch()

    has_poses: bool | None = None
    """Whether a stream with these poses has poses; None keeps the property of the stream."""

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """Properties of a stream with these poses."""
        return info if self.has_poses is None else replace(info, has_poses=self.has_poses, pose_notes=())

    def place(self, frame: Frame) -> Frame:
        """Return the frame with its pose, None where unknown; frames come in order."""
        return self.watch.watched(frame, self.name)

    def report(self) -> dict[str, Any]:
        """Name of the source, and statistics."""
        return {"source": self.name, "leaps": self.watch.leaps}

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
        from modt.sources.pose_file import read_poses, sensor_poses  # used by this source of poses alone

        super().__init__()
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
        return super().place(replace(frame, T_world_sensor=self._poses[frame.index]))

    def _require(self, frame: int) -> None:
        if frame >= len(self._poses):
            cause = f"{len(self._poses)} poses, too few for frame {frame}"
            raise MisuseError(self.name, cause, "give a line for every frame from 0 on, or fewer --frames")
