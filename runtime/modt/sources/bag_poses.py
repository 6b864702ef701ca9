"""Poses of a ROS 2 recording: which topic has them, where the sensor sits, and the pose at each sweep."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.ros2 import odometry
from modt.ros2.cdr import MessageError
from modt.ros2.odometry import Transforms, read_odometry, read_transforms
from modt.sources.bag_file import BagMessage
from modt.sources.bag_files import Bag
from modt.sources.pose_buffer import PoseBuffer
from modt.sources.stamp_check import STEP_S, StampCheck
from modt.types import Float64, Frame

READ_TRANSFORMS = 2000
"""Number of messages of transforms by which the frames of a robot and the fixed ones among them are known."""
LATE_S = 5.0
"""Time that a localisation may need for a pose [s]; a stamp farther back is on another clock than the sweeps."""
BASE = "base_link"
"""Frame of a robot's poses that name none (REP 105)."""
CONTINUOUS = "odom"
"""Last part of the name of the frame in which poses never jump (REP 105)."""


@dataclass(frozen=True)
class PoseTopic:
    """A topic of poses.

    Attributes:
        name: the topic.
        T_child_sensor: (4, 4) pose of the sensor in the frame whose poses they are.
        edge: parent and child of the transform that is the pose; None for a topic of odometry.
        kind: type of the messages of a topic of odometry.
    """

    name: str
    T_child_sensor: Float64
    edge: tuple[str, str] | None = None
    kind: str = odometry.TYPE

    def __str__(self) -> str:
        return self.name if self.edge is None else f"{self.name} ({self.edge[1]} in {self.edge[0]})"

    def poses(self, message: bytes) -> Iterator[tuple[float, Float64]]:
        """Yield stamp [s] and (4, 4) pose of the sensor.

        Raises:
            MessageError: the message cannot be used.
        """
        if self.edge is None:
            pose = read_odometry(message, self.kind)
            yield pose.stamp_s, pose.T_odom_child @ self.T_child_sensor
            return
        for transform in read_transforms(message):
            if (transform.parent, transform.child) == self.edge:
                yield transform.stamp_s, transform.T_parent_child @ self.T_child_sensor


def find_poses(bag: Bag, sensor: str, asked: str | None) -> tuple[PoseTopic | None, tuple[str, ...]]:
    """The topic of the poses, and notes. None without poses, or without a transform from their frame to the sensor's.

    Args:
        bag: the recording.
        sensor: frame of the points.
        asked: topic of odometry or of transforms to use; None to choose.

    Raises:
        MisuseError: there are no poses in the topic that is asked for.
    """
    topics = {name: topic for name, topic in bag.topics().items() if topic.count and topic.encoding == "cdr"}
    odometries = sorted(name for name, topic in topics.items() if topic.type == odometry.TYPE)
    # Single poses are goals or guesses as often as they are where the robot is, so none is used unasked.
    single = sorted(
        name for name, topic in topics.items() if topic.type in odometry.NAMES_CHILD.keys() - {odometry.TYPE}
    )
    trees = sorted(name for name, topic in topics.items() if topic.type == odometry.TF)
    moving = [name for name in trees if not _is_static(name)]
    if asked is not None:
        asked = "/" + asked.strip("/")
        if asked not in {*odometries, *single, *moving}:
            there = ", ".join([*odometries, *single, *moving]) or "none"
            raise MisuseError(asked, "no poses in this topic", f"topics of odometry, poses and transforms: {there}")
        odometries = [name for name in (*odometries, *single) if name == asked]
        moving = [name for name in moving if name == asked]
    if len(odometries) > 1:
        remedy = "choose by --capture odometry=NAME"
        return None, (f"several topics of odometry ({', '.join(odometries)}): none is used, no poses; {remedy}",)
    tree = _tree(bag, trees)
    if odometries:
        return _of_odometry(bag, odometries[0], topics[odometries[0]].type, sensor, tree)
    poses, notes = _of_transforms(moving, sensor, tree)
    if poses is None and single:
        notes = (
            *notes,
            f"topics of single poses are used if asked for, by --capture odometry=NAME: {', '.join(single)}",
        )
    return poses, notes


def _of_odometry(
    bag: Bag, topic: str, kind: str, sensor: str, tree: Transforms
) -> tuple[PoseTopic | None, tuple[str, ...]]:
    """Poses of a topic of odometry. Those that name no frame are of the robot's base, if it leads to the sensor."""
    base = ""
    for message in islice(bag.messages({topic}), READ_TRANSFORMS):
        with suppress(MessageError):
            base = read_odometry(message.data, kind).child_frame_id
            break
    notes: tuple[str, ...] = ()
    if not odometry.NAMES_CHILD[kind]:
        base = BASE if tree.between(BASE, sensor) is not None else ""
        notes = (f"poses of {topic} name no frame: taken as those of {base or 'the sensor'}",)
    if base.lstrip("/") == sensor.lstrip("/") or not base or not sensor:
        return PoseTopic(topic, np.eye(4), kind=kind), notes
    T_base_sensor = tree.between(base, sensor)
    if T_base_sensor is None:
        where = f"/tf_static does not lead from {base}, their frame, to {sensor}, nor do other fixed transforms"
        return None, (f"poses of {topic} are not used: {where}",)
    return PoseTopic(topic, T_base_sensor, kind=kind), notes


def _of_transforms(topics: list[str], sensor: str, tree: Transforms) -> tuple[PoseTopic | None, tuple[str, ...]]:
    """Poses by the transform into the odometry's frame, else by the topmost one that moves."""
    chain = tree.chain(sensor)
    edges = [(parent, child) for child, parent in pairwise(chain) if tree.moves(child)]
    edge = next((edge for edge in edges if edge[0].rpartition("/")[2] == CONTINUOUS), edges[-1] if edges else None)
    if edge is None or not topics:
        return None, ("no nav_msgs/Odometry: no poses, and no transform moves the sensor",)
    T_child_sensor = tree.between(edge[1], sensor)
    if T_child_sensor is None:
        return None, (f"poses of {edge[1]} are not used: the transforms between it and {sensor} move",)
    if len(topics) > 1:
        remedy = "choose by --capture odometry=NAME"
        return None, (f"several topics of transforms ({', '.join(topics)}): none is used, no poses; {remedy}",)
    return PoseTopic(topics[0], T_child_sensor, edge), ()


def _tree(bag: Bag, topics: list[str]) -> Transforms:
    """The robot's frames by its topics of transforms, in a namespace or not; fixed ones may be in any of them."""
    tree = Transforms()
    for topic in topics:
        for message in islice(bag.messages({topic}), None if _is_static(topic) else READ_TRANSFORMS):
            with suppress(MessageError):
                tree.add(message.data)
    return tree


def _is_static(topic: str) -> bool:
    return topic.rpartition("/")[2] == odometry.TF_STATIC


class RecordedPoses:
    """Poses of a recording on the clock of its sweeps, which begins at a stamp and a recorded time [s].

    Attributes:
        topics: the topic to read, if there is one.
        lost: number of messages that cannot be read.
    """

    def __init__(self, topic: PoseTopic | None, began: tuple[float, float]) -> None:
        self.topics = set() if topic is None else {topic.name}
        self.lost = 0
        self._topic = topic
        self._began = began
        self._buffer = PoseBuffer(OdometryConfig())
        self._stamps: StampCheck | None = None

    @property
    def newest_s(self) -> float:
        """Stamp of the latest pose [s], minus infinity before the first."""
        return self._buffer.newest_s

    def add(self, message: BagMessage) -> None:
        """Add the poses of a message; one that is wrong or out of order is left out."""
        if message.flaw or self._topic is None:
            self.lost += 1
            return
        try:
            poses = [*self._topic.poses(message.data)]
        except MessageError:
            self.lost += 1
            return
        if self._stamps is None and poses:
            self._stamps = self._begin(poses[0][0], message.recorded_s)
        for pose_s, T_world_sensor in poses:
            if self._stamps is None or self._stamps.doubt(pose_s, message.recorded_s):
                continue
            stamp_s = pose_s + self._stamps.shift_s - self._began[0]
            if stamp_s > self.newest_s:
                self._buffer.add(stamp_s, T_world_sensor)

    def _begin(self, pose_s: float, recorded_s: float) -> StampCheck:
        """Check of the stamps, by that of the first pose. Their clock is that of the sweeps, or follows it."""
        begin_s = recorded_s - STEP_S / 2
        clock_s = self._began[0] - self._began[1]  # the clock of the sweeps relative to that of the recording
        late_s = recorded_s + clock_s - pose_s
        return StampCheck((pose_s, recorded_s) if 0 <= late_s < LATE_S else (clock_s + begin_s, begin_s))

    def place(self, frame: Frame) -> Frame:
        """The frame with its pose, None where the latest poses are too old."""
        return self._buffer.placed(frame)
