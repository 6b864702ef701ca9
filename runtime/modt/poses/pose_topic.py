"""Poses received from a nav_msgs/Odometry topic of ROS 2."""

from __future__ import annotations

import numpy as np

from modt.address import Address
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.poses.received_poses import ReceivedPoses
from modt.ros2.address import domain_of, topic_of
from modt.ros2.dds import Message, Subscription, participant
from modt.ros2.odometry import TYPE, read_odometry
from modt.sources.pose_buffer import CAPACITY
from modt.types import Float64

MOUNT = ("x", "y", "z", "roll", "pitch", "yaw")


class PoseTopic(ReceivedPoses):
    """Reads the topic once a frame without blocking; T_base_sensor is the pose of the sensor on the robot."""

    def __init__(self, subscription: Subscription, config: OdometryConfig, name: str, T_base_sensor: Float64) -> None:
        super().__init__(config, name)
        self._subscription = subscription
        self._T_base_sensor = T_base_sensor

    def _take(self) -> list[Message]:
        taken = self._subscription.take()
        self.received += len(taken)
        return taken

    def _read(self, message: Message, /) -> tuple[float, Float64]:
        odometry = read_odometry(message.data)
        return odometry.stamp_s, odometry.T_odom_child @ self._T_base_sensor


def open_topic(address: Address, config: OdometryConfig) -> PoseTopic:
    """Subscribe to ros2:///TOPIC?domain=N&base_to_sensor=x,y,z,roll,pitch,yaw [m, rad].

    Raises:
        MisuseError: Cyclone DDS is not installed, or the address names no topic, domain or mount.
        ModtError: the domain cannot be joined.
    """
    topic = topic_of(address)
    T_base_sensor = _mount(address.option("base_to_sensor", "0,0,0,0,0,0"), address.text)
    joined = participant(domain_of(address))
    return PoseTopic(Subscription(joined, topic, TYPE, depth=CAPACITY), config, address.text, T_base_sensor)


def _mount(text: str, subject: str) -> Float64:
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.array([np.nan])
    if len(numbers) != len(MOUNT) or not np.isfinite(numbers).all():
        raise MisuseError(subject, f"base_to_sensor {text!r} is no pose", f"give {','.join(MOUNT)} [m, rad]")
    return se3(rotation_zyx(*numbers[3:]), numbers[:3])
