"""Recordings of ROS 2: PointCloud2 messages as frames, Odometry messages as their poses."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import combinations, islice, pairwise
from pathlib import Path

import numpy as np

from modt.config import OdometryConfig
from modt.errors import MisuseError, ModtError
from modt.ros2 import odometry, point_cloud2
from modt.ros2.cdr import CdrReader, MessageError
from modt.ros2.odometry import StaticTransforms, read_odometry
from modt.ros2.point_cloud2 import PointCloud, read_cloud
from modt.sources.bag_files import BagFile, BagMessage, BagTopic, bag_files, messages_of
from modt.sources.pose_buffer import PoseBuffer
from modt.sources.stamp_check import STEP_S, StampCheck
from modt.sources.stream import Faults, StreamInfo, Sweep
from modt.types import Float64, Frame, Self

Poses = tuple[str, Float64]
"""Topic of the poses, and pose of the sensor in the frame that they describe."""


def find_poses(
    files: list[BagFile], topics: dict[str, BagTopic], sensor: str
) -> tuple[Poses | None, tuple[str, ...]]:
    """Topic of the poses with the mount of the sensor, and notes.

    The topic is None without poses, or without a transform from their frame to the sensor's.
    """
    names = sorted(name for name, topic in topics.items() if topic.type == odometry.TYPE and topic.count)
    if not names:
        return None, ("no nav_msgs/Odometry: no poses",)
    if len(names) > 1:
        return None, (f"several topics of odometry ({', '.join(names)}): none is used, no poses",)
    (topic,) = names
    base = ""
    with suppress(MessageError, StopIteration):
        base = read_odometry(next(messages_of(files, {topic})).data).child_frame_id
    if base.lstrip("/") == sensor.lstrip("/") or not base or not sensor:
        return (topic, np.eye(4)), ()
    transforms = StaticTransforms()
    if topics.get(odometry.TF_STATIC, BagTopic("", 0)).type == odometry.TF:
        for message in messages_of(files, {odometry.TF_STATIC}):
            with suppress(MessageError):
                transforms.add(message.data)
    T_base_sensor = transforms.between(base, sensor)
    if T_base_sensor is None:
        where = f"{odometry.TF_STATIC} does not lead from {base}, their frame, to {sensor}"
        return None, (f"poses of {topic} are not used: {where}",)
    return (topic, T_base_sensor), ()


class RecordedPoses:
    """Poses of a recording on the clock of its sweeps, which begins at a stamp and a recorded time [s]."""

    def __init__(self, poses: Poses | None, began: tuple[float, float]) -> None:
        self.topics: set[str] = set()
        self._T_base_sensor = np.eye(4)
        if poses is not None:
            topic, self._T_base_sensor = poses
            self.topics = {topic}
        self._began = began
        self._buffer = PoseBuffer(OdometryConfig())
        self._stamps: StampCheck | None = None

    @property
    def newest_s(self) -> float:
        """Stamp of the latest pose [s], minus infinity before the first."""
        return self._buffer.newest_s

    def add(self, message: BagMessage) -> None:
        """Add the pose of a message; one that is wrong or out of order is left out."""
        if self._stamps is None:  # the clock of the poses is that of the sweeps
            began_s = message.recorded_s - STEP_S / 2
            self._stamps = StampCheck((self._began[0] - self._began[1] + began_s, began_s))
        with suppress(MessageError):
            pose = read_odometry(message.data)
            if self._stamps.doubt(pose.stamp_s, message.recorded_s):
                return
            stamp_s = pose.stamp_s + self._stamps.shift_s - self._began[0]
            if stamp_s > self.newest_s:
                self._buffer.add(stamp_s, pose.T_odom_child @ self._T_base_sensor)

    def place(self, frame: Frame) -> Frame:
        """The frame with its pose, None where the latest poses are too old."""
        return replace(frame, T_world_sensor=self._buffer.at(frame.stamp_s))


PEEKED = 50
"""Greatest number of messages that are searched for the first usable sweeps."""
COMPARED = 4
"""Number of first sweeps whose stamps are compared. The first stamp that fits a later one begins the stream."""


class BagStream:
    """Frames of a recording; stamps count from its first usable sweep.

    A frame is held back until a pose at least as late or the next sweep is read, so that its pose is interpolated.
    Unusable messages are counted and skipped, the first ones are logged.
    """

    def __init__(
        self, info: StreamInfo, files: list[BagFile], topic: str, began: tuple[float, float], poses: Poses | None
    ) -> None:
        """`began`: stamp and recorded time of the first sweep whose stamp is accepted [s]."""
        self.info = info
        self.faults = Faults()
        self._files = files
        self._topic = topic
        self._began = began
        self._poses = poses
        self._first = 0
        self._last = info.n_frames or 0

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, with poses where there are any."""
        poses = RecordedPoses(self._poses, self._began)
        stamps = StampCheck(self._began)
        held: Frame | None = None
        index = -1
        for message in self._readable({self._topic} | poses.topics):
            is_sweep = message.topic == self._topic
            if is_sweep:
                index += 1
            else:
                poses.add(message)
            if held is not None and (is_sweep or poses.newest_s >= held.stamp_s):
                yield poses.place(held)
                held = None
            if index >= self._last:
                return
            if is_sweep and index >= self._first:
                held = self._frame(index, message, stamps)
            elif is_sweep:
                with suppress(MessageError):
                    stamps.doubt(CdrReader(message.data).stamp_s() or message.recorded_s, message.recorded_s)
        if held is not None:
            yield poses.place(held)

    def between(self, first: int, last: int | None) -> Self:
        """Frames with first <= index < last; others are not decoded."""
        part = copy.copy(self)
        part.faults = Faults()
        part._first = max(first, self._first)
        part._last = max(part._first, self._last if last is None else min(last, self._last))
        part.info = replace(self.info, n_frames=part._last - part._first, end=part._last)
        return part

    def _readable(self, topics: set[str]) -> Iterator[BagMessage]:
        """Messages up to where the recording is broken."""
        try:
            yield from messages_of(self._files, topics)
        except ModtError as error:
            self.faults.report(self._last, self._topic, error.cause, skipped=True)

    def _frame(self, index: int, message: BagMessage, stamps: StampCheck) -> Frame | None:
        try:
            cloud = read_cloud(message.data)
        except MessageError as error:
            self.faults.report(index, self._topic, str(error), skipped=True)
            return None
        sweep = Sweep(_stamp_s(cloud, message), cloud.points, cloud.turn_s)
        return stamps.frame(sweep, message.recorded_s, index, self._topic, self.faults, began_s=self._began[0])


def open_bag(path: Path, period_s: float, topic: str | None = None) -> BagStream:
    """Stream of a rosbag2 folder, a .db3 or an .mcap file; `period_s` holds for a recording of a single sweep.

    Raises:
        MisuseError: no topic of point clouds, several and none is chosen, or no library to read the file.
        ModtError: the file cannot be read.
    """
    path = path.resolve()
    files = bag_files(path)
    topics: dict[str, BagTopic] = {}
    for file in files:
        for name, entry in file.topics().items():
            topics[name] = BagTopic(entry.type, entry.count + (topics[name].count if name in topics else 0))
    chosen = _choose(path, topics, topic)
    began = _first_clouds(path, files, chosen)
    stamps = [(_stamp_s(cloud, message), message.recorded_s) for cloud, message in began]
    first = next((a for a, b in combinations(stamps, 2) if not StampCheck(a).doubt(*b)), stamps[0])
    steps_s = (b[0] - a[0] for a, b in pairwise(stamps) if b[0] > a[0] and not StampCheck(a).doubt(*b))
    poses, notes = find_poses(files, topics, began[0][0].frame_id)
    info = StreamInfo(
        name=path.stem if path.is_file() else path.name,
        layout="rosbag2",
        n_frames=topics[chosen].count,
        period_s=next(steps_s, period_s),
        has_poses=poses is not None,
        pose_notes=notes,
        end=topics[chosen].count,
    )
    return BagStream(info, files, chosen, first, poses)


def _choose(path: Path, topics: dict[str, BagTopic], asked: str | None) -> str:
    clouds = sorted(name for name, topic in topics.items() if topic.type == point_cloud2.TYPE and topic.count)
    if asked is not None:
        asked = "/" + asked.strip("/")
        if asked not in clouds:
            there = ", ".join(clouds) or "none"
            raise MisuseError(path, f"no point clouds in {asked}", f"topics of sensor_msgs/PointCloud2: {there}")
        return asked
    if not clouds:
        there = ", ".join(sorted({topic.type for topic in topics.values() if topic.count})) or "nothing"
        raise MisuseError(path, "no sensor_msgs/PointCloud2", f"record the driver's point clouds; it holds {there}")
    if len(clouds) > 1:
        raise MisuseError(
            path, f"{len(clouds)} topics of point clouds", f"choose by --capture topic=NAME: {', '.join(clouds)}"
        )
    return clouds[0]


def _first_clouds(path: Path, files: list[BagFile], topic: str) -> list[tuple[PointCloud, BagMessage]]:
    """First usable sweeps, at least one.

    Raises:
        ModtError: no message can be used.
    """
    clouds: list[tuple[PointCloud, BagMessage]] = []
    refused = "no message"
    try:
        for message in islice(messages_of(files, {topic}), PEEKED):
            try:
                clouds.append((read_cloud(message.data), message))
            except MessageError as error:
                refused = str(error)
            if len(clouds) == COMPARED:
                break
    except ModtError:
        if not clouds:
            raise
    if not clouds:
        remedy = "record sensor_msgs/PointCloud2 in CDR, with x, y, z [m] as float32"
        raise ModtError(path, f"no usable sweep at the begin of {topic} ({refused})", remedy)
    return clouds


def _stamp_s(cloud: PointCloud, message: BagMessage) -> float:
    return cloud.ahead_s or message.recorded_s
