"""nav_msgs/Odometry, and tf2_msgs/TFMessage of /tf_static."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, quaternion_of, rotation_of, se3
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
        T_odom_child: (4, 4) pose in the frame of the header.
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
    stamp_s, _ = cdr.header()
    child_frame_id = cdr.text()
    return OdometryMessage(stamp_s, child_frame_id, read_pose(cdr))


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


TF = "tf2_msgs/TFMessage"
"""Type of the messages of transforms."""
TF_STATIC = "/tf_static"
"""Topic of the robot's fixed transforms."""
MAX_TRANSFORMS = 10_000


class StaticTransforms:
    """The tree of the robot's fixed frames."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Float64]] = {}

    def add(self, message: bytes) -> None:
        """Add the transforms of a message.

        Raises:
            MessageError: it is not a TFMessage.
        """
        cdr = CdrReader(message)
        n = cdr.count()
        if n > MAX_TRANSFORMS:
            raise MessageError("malformed", f"{n} transforms")
        for _ in range(n):
            _, parent = cdr.header()
            child = cdr.text()
            self._parents[child.lstrip("/")] = (parent.lstrip("/"), read_pose(cdr))

    def between(self, base: str, sensor: str) -> Float64 | None:
        """(4, 4) pose of `sensor` in `base`; None if they are not connected."""
        base_root, T_root_base = self._root(base.lstrip("/"))
        sensor_root, T_root_sensor = self._root(sensor.lstrip("/"))
        return inverse(T_root_base) @ T_root_sensor if base_root == sensor_root else None

    def _root(self, frame: str) -> tuple[str, Float64]:
        """The root of a frame, and the pose of the frame in it."""
        T: Float64 = np.eye(4)
        for _ in range(len(self._parents)):  # ends if the transforms form a loop
            if frame not in self._parents:
                break
            frame, T_parent_frame = self._parents[frame]
            T = T_parent_frame @ T
        return frame, T
