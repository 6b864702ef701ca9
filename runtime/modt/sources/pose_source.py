"""Where the sensor was, from elsewhere than the stream itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, Self

from modt.errors import MisuseError
from modt.geometry import Camera
from modt.sources.pose_file import read_poses, sensor_poses
from modt.sources.stream import Faults, Stream, StreamInfo
from modt.types import Frame


class Odometry(Protocol):
    """Places frames."""

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """What is known of a stream whose poses are these: whether it has any, and what is missing of them."""
        ...

    def place(self, frame: Frame) -> Frame:
        """The frame with its pose, None where it is not known. Frames come in their order."""
        ...

    def report(self) -> dict[str, Any]:
        """What there was, and what could not be used."""
        ...

    def close(self) -> None:
        """No more will be asked."""
        ...


class OwnOdometry:
    """The stream's own."""

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """What was known already."""
        return info

    def place(self, frame: Frame) -> Frame:
        """As it is."""
        return frame

    def report(self) -> dict[str, Any]:
        """Which one it was."""
        return {"source": "own"}

    def close(self) -> None:
        """Nothing to be done."""


class NoOdometry:
    """Nobody knows: the proposals must tell."""

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """No frame has one, as was asked for."""
        return replace(info, has_poses=False, pose_notes=())

    def place(self, frame: Frame) -> Frame:
        """Without a pose."""
        return replace(frame, T_world_sensor=None)

    def report(self) -> dict[str, Any]:
        """Which one it was."""
        return {"source": "none"}

    def close(self) -> None:
        """Nothing to be done."""


class ListedPoses:
    """Poses of a file in KITTI's odometry format: line k, from 0, is that of frame number k.

    Args:
        path: the file.
        camera: if the stream has one, the poses are its (KITTI's rectified left camera); else they are the sensor's.
        end: one more than the number of the last frame, None where it is not known.

    Raises:
        MisuseError: the file is missing, a line is no pose, or there are too few.
    """

    def __init__(self, path: Path, camera: Camera | None, end: int | None) -> None:
        self.path = path
        poses = read_poses(path)
        self._poses = poses if camera is None else sensor_poses(poses, camera.T_camera_sensor)
        if end is not None and end > len(poses):
            raise self._too_few(end - 1)

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """Every frame has one."""
        return replace(info, has_poses=True, pose_notes=())

    def place(self, frame: Frame) -> Frame:
        """With the pose of its number.

        Raises:
            MisuseError: there are fewer.
        """
        if frame.index >= len(self._poses):
            raise self._too_few(frame.index)
        return replace(frame, T_world_sensor=self._poses[frame.index])

    def report(self) -> dict[str, Any]:
        """Which file it was."""
        return {"source": str(self.path)}

    def close(self) -> None:
        """Nothing to be done."""

    def _too_few(self, frame: int) -> MisuseError:
        cause = f"{len(self._poses)} poses, too few for frame {frame}"
        return MisuseError(self.path, cause, "give a line for every frame from 0 on, or fewer --frames")


class PosedStream:
    """A stream whose frames carry the poses of another odometry.

    Args:
        stream: the frames.
        odometry: their poses.
    """

    def __init__(self, stream: Stream, odometry: Odometry) -> None:
        self._stream, self.odometry = stream, odometry
        self.info: StreamInfo = odometry.of_stream(stream.info)
        self.faults: Faults = stream.faults

    def __iter__(self) -> Iterator[Frame]:
        """The frames, posed."""
        return (self.odometry.place(frame) for frame in self._stream)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last."""
        return type(self)(self._stream.between(first, last), self.odometry)
