"""Where the poses of a recording of ROS 2 come from."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

import numpy as np

from modt.ros2 import odometry, static_transforms
from modt.ros2.cdr import MessageError
from modt.ros2.odometry import read_odometry
from modt.ros2.static_transforms import StaticTransforms
from modt.sources.bag_files import BagFile, BagMessage, BagTopic, messages_of
from modt.types import Float64


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
