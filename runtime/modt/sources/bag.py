"""Recordings of ROS 2: PointCloud2 messages as frames, Odometry messages as their poses."""

from __future__ import annotations

import copy
import logging
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Self

import numpy as np

from modt.config import OdometryConfig
from modt.errors import MisuseError, ModtError, ScanError
from modt.ros2 import odometry, point_cloud2, static_transforms
from modt.ros2.cdr import MessageError
from modt.ros2.odometry import read_odometry
from modt.ros2.point_cloud2 import PointCloud, read_cloud
from modt.ros2.static_transforms import StaticTransforms
from modt.sources.bag_files import BagFile, BagMessage, BagTopic, bag_files, messages_of
from modt.sources.pose_buffer import PoseBuffer
from modt.sources.scan_file import sanitised
from modt.sources.stream import MAX_KEPT_FAULTS, Fault, Faults, StreamInfo
from modt.types import Float64, Frame


@dataclass(frozen=True, slots=True)
class Poses:
    """The topic of the poses, and where the sensor sits on the frame that they are of."""

    topic: str
    T_base_sensor: Float64


def find_poses(
    files: list[BagFile], topics: dict[str, BagTopic], sensor: str
) -> tuple[Poses | None, tuple[str, ...]]:
    """The topic of the poses, None without one and where its frame does not lead to the sensor's; and notes."""
    found = sorted(name for name, topic in topics.items() if topic.type == odometry.TYPE and topic.count)
    if not found:
        return None, ("no nav_msgs/Odometry: no poses",)
    if len(found) > 1:
        return None, (f"several topics of odometry ({', '.join(found)}): none is used, no poses",)
    (topic,) = found
    base = next((_base(message) for message in islice(messages_of(files, {topic}), 1)), "")
    if base.lstrip("/") == sensor.lstrip("/") or not base or not sensor:
        return Poses(topic, np.eye(4)), ()
    transforms = StaticTransforms()
    if topics.get(static_transforms.TOPIC, BagTopic("", 0)).type == static_transforms.TYPE:
        for message in messages_of(files, {static_transforms.TOPIC}):
            with suppress(MessageError):
                transforms.add(message.data)
    T_base_sensor = transforms.between(base, sensor)
    if T_base_sensor is None:
        where = f"{static_transforms.TOPIC} does not lead from {base}, of which they are, to {sensor}"
        return None, (f"poses of {topic} are not used: {where}",)
    return Poses(topic, T_base_sensor), ()


def _base(message: BagMessage) -> str:
    try:
        return read_odometry(message.data).child_frame_id
    except MessageError:
        return ""


log = logging.getLogger(__name__)

PEEKED = 50
"""Messages of a topic read before the first frame, until one can be used."""


class BagStream:
    """The frames of a recording; stamps count from its first usable sweep.

    A frame is held back until there is a pose at least as late, or the next sweep, so that its pose is interpolated.
    Messages that cannot be used are counted and skipped, the first ones are logged.
    """

    def __init__(
        self, info: StreamInfo, files: list[BagFile], topic: str, began_s: float, poses: Poses | None
    ) -> None:
        self.info, self.faults = info, Faults()
        self._files, self._topic, self._began_s, self._poses = files, topic, began_s, poses
        self._first, self._last = 0, info.n_frames or 0

    def __iter__(self) -> Iterator[Frame]:
        """The frames, with poses where there are any."""
        buffer, held, last_s, index = PoseBuffer(OdometryConfig()), None, -np.inf, -1
        topics = {self._topic} if self._poses is None else {self._topic, self._poses.topic}
        for message in self._readable(topics):
            if message.topic != self._topic:
                self._keep(message, buffer)
            else:
                index += 1
            if held is not None and (message.topic == self._topic or buffer.newest_s >= held.stamp_s):
                yield replace(held, T_world_sensor=buffer.at(held.stamp_s))
                held = None
            if index >= self._last:
                return
            if message.topic == self._topic and index >= self._first:
                held = self._frame(index, message, last_s)
                last_s = last_s if held is None else held.stamp_s
        if held is not None:
            yield replace(held, T_world_sensor=buffer.at(held.stamp_s))

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last; others are not decoded."""
        part = copy.copy(self)
        part.faults = Faults()
        part._first = max(first, self._first)
        part._last = max(part._first, self._last if last is None else min(last, self._last))
        part.info = replace(self.info, n_frames=part._last - part._first, end=part._last)
        return part

    def _readable(self, topics: set[str]) -> Iterator[BagMessage]:
        """The messages up to where the recording is broken."""
        try:
            yield from messages_of(self._files, topics)
        except ModtError as error:
            self._fault(self._last, error.cause, skipped=True)

    def _frame(self, index: int, message: BagMessage, last_s: float) -> Frame | None:
        try:
            cloud = read_cloud(message.data)
            points, flaws = sanitised(cloud.points, self._topic)
        except (MessageError, ScanError) as error:
            self._fault(index, error.cause if isinstance(error, ScanError) else str(error), skipped=True)
            return None
        stamp_s = _stamp_s(cloud, message) - self._began_s
        if stamp_s < last_s:
            self._fault(index, f"stamped {last_s - stamp_s:.3f} s before the last sweep", skipped=True)
            return None
        if flaws:
            self._fault(index, "; ".join(flaws), skipped=False)
        return Frame(index, stamp_s, points, turn_s=cloud.turn_s)

    def _keep(self, message: BagMessage, buffer: PoseBuffer) -> None:
        try:
            pose = read_odometry(message.data)
        except MessageError:
            return
        if self._poses is not None:
            buffer.add(pose.stamp_s - self._began_s, pose.T_odom_child @ self._poses.T_base_sensor)

    def _fault(self, index: int, cause: str, *, skipped: bool) -> None:
        if self.faults.add(Fault(index, self._topic, cause, skipped)):
            more = "; later faults are only counted" if self.faults.count == MAX_KEPT_FAULTS else ""
            log.warning("%s %d: %s%s%s", self._topic, index, cause, "; frame skipped" if skipped else "", more)


def open_bag(path: Path, period_s: float, topic: str | None = None) -> BagStream:
    """The stream of a rosbag2 folder, a .db3 or an .mcap file; period_s where it has one sweep alone.

    Raises:
        MisuseError: no topic of point clouds, or several and none is chosen; or no library to read the file.
        ModtError: the file cannot be read.
    """
    path = path.resolve()
    files = bag_files(path)
    topics: dict[str, BagTopic] = {}
    for file in files:
        for name, found in file.topics().items():
            topics[name] = BagTopic(found.type, found.count + (topics[name].count if name in topics else 0))
    chosen = _choose(path, topics, topic)
    began = list(islice(_clouds(files, chosen), 2))
    if not began:
        raise ModtError(path, f"no usable sweep at the begin of {chosen}", "record sensor_msgs/PointCloud2 in CDR")
    stamps = [_stamp_s(cloud, message) for cloud, message in began]
    poses, notes = find_poses(files, topics, began[0][0].frame_id)
    info = StreamInfo(
        name=path.stem if path.is_file() else path.name,
        layout="rosbag2",
        sequence=0,
        n_frames=topics[chosen].count,
        period_s=stamps[1] - stamps[0] if len(stamps) > 1 and stamps[1] > stamps[0] else period_s,
        camera=None,
        has_poses=poses is not None,
        pose_notes=notes,
        end=topics[chosen].count,
    )
    return BagStream(info, files, chosen, stamps[0], poses)


def _choose(path: Path, topics: dict[str, BagTopic], asked: str | None) -> str:
    clouds = sorted(name for name, topic in topics.items() if topic.type == point_cloud2.TYPE and topic.count)
    if asked is not None:
        asked = "/" + asked.strip("/")
        if asked not in clouds:
            there = ", ".join(clouds) or "none"
            raise MisuseError(path, f"no point clouds in {asked}", f"topics of sensor_msgs/PointCloud2: {there}")
        return asked
    if not clouds:
        there = ", ".join(sorted({topic.type for topic in topics.values()})) or "nothing"
        raise MisuseError(path, "no sensor_msgs/PointCloud2", f"record the driver's point clouds; it holds {there}")
    if len(clouds) > 1:
        raise MisuseError(
            path, f"{len(clouds)} topics of point clouds", f"choose by --capture topic=NAME: {', '.join(clouds)}"
        )
    return clouds[0]


def _clouds(files: list[BagFile], topic: str) -> Iterator[tuple[PointCloud, BagMessage]]:
    """The usable ones among the first messages."""
    for message in islice(messages_of(files, {topic}), PEEKED):
        try:
            yield read_cloud(message.data), message
        except MessageError:
            continue


def _stamp_s(cloud: PointCloud, message: BagMessage) -> float:
    return cloud.ahead_s or message.recorded_s
