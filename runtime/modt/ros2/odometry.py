"""nav_msgs/Odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.geometry import quaternion_of, rotation_of, se3
from modt.ros2.cdr import CdrReader, CdrWriter, MessageError
from modt.types import Float64

TYPE = "nav_msgs/Odometry"
UNKNOWN = f"{8 * (36 + 6 + 36)}x"
"""Zeros for the covariance of the pose, and for the twist with its covariance."""


@dataclass(frozen=True, slots=True)
class OdometryMessage:
    """A pose of the robot.

    Attributes:
        stamp_s: its time [s].
        child_frame_id: the frame whose pose it is.
        T_odom_child: (4, 4) that pose in the frame of the header.
    """

    stamp_s: float
    child_frame_id: str
    T_odom_child: Float64


def read_odometry(message: bytes) -> OdometryMessage:
    """The pose in a message; covariance and velocity are not used.

    Raises:
        MessageError: `malformed`, or `non_finite`.
    """
    cdr = CdrReader(message)
    stamp_s, _, child = cdr.stamp_s(), cdr.text(), cdr.text()
    return OdometryMessage(stamp_s, child, read_pose(cdr))


def read_pose(cdr: CdrReader) -> Float64:
    """(4, 4) of a geometry_msgs/Pose or Transform.

    Raises:
        MessageError: `malformed`, or `non_finite`.
    """
    numbers = cdr.doubles(7)
    if not np.isfinite(numbers).all():
        raise MessageError("non_finite", "the pose is not finite")
    if not 0.9 < math.hypot(*numbers[3:]) < 1.1:
        raise MessageError("malformed", "the quaternion is no rotation")
    return se3(rotation_of(np.array(numbers[3:])), numbers[:3])


def write_odometry(stamp_s: float, frame_id: str, child_frame_id: str, T_odom_child: Float64) -> bytes:
    """A message of a pose, without covariance and velocity."""
    cdr = CdrWriter()
    cdr.header(stamp_s, frame_id)
    cdr.text(child_frame_id)
    cdr.record(("7d", UNKNOWN), *T_odom_child[:3, 3].tolist(), *quaternion_of(T_odom_child).tolist())
    return cdr.message()
