"""nav_msgs/Odometry and single poses, and tf2_msgs/TFMessage of /tf and /tf_static."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from modt.geometry import inverse, quaternion_of, rotation_of, se3
from modt.ros2.cdr import CdrReader, CdrWriter, MessageError
from modt.types import Float64

TYPE = "nav_msgs/Odometry"
NAMES_CHILD = {
    TYPE: True,
    "geometry_msgs/TransformStamped": True,
    "geometry_msgs/PoseStamped": False,
    "geometry_msgs/PoseWithCovarianceStamped": False,
}
"""Types of messages with a stamp and a pose, and whether they name the frame whose pose it is."""
UNKNOWN = f"{8 * (36 + 6 + 36)}x"
"""Zeros for the covariance of the pose, and for the twist with its covariance."""


@dataclass(frozen=True)
class OdometryMessage:
    """A pose of the robot.

    Attributes:
        stamp_s: its time [s].
        child_frame_id: the frame whose pose it is; "" where the message does not name it.
        T_odom_child: (4, 4) pose in the frame of the header.
    """

    stamp_s: float
    child_frame_id: str
    T_odom_child: Float64


def read_odometry(message: bytes, kind: str = TYPE) -> OdometryMessage:
    """The pose in a message of a kind in NAMES_CHILD; covariance and velocity are not used.

    Raises:
        MessageError: `malformed`, or `non_finite`.
    """
    cdr = CdrReader(message)
    stamp_s, _ = cdr.header()
    child_frame_id = cdr.text() if NAMES_CHILD[kind] else ""
    return OdometryMessage(stamp_s, child_frame_id, pose_of(cdr.doubles(7)))


def pose_of(numbers: Float64) -> Float64:
    """(4, 4) of a position and a quaternion x, y, z, w.

    Raises:
        MessageError: `malformed`, or `non_finite`.
    """
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
TF_STATIC = "tf_static"
"""Last part of the topic of a robot's fixed transforms."""
MAX_TRANSFORMS = 10_000
FIXED_M = 1e-3
"""Greatest change of the elements of a transform that counts as fixed."""


@dataclass(frozen=True)
class Transform:
    """Pose of a frame in its parent at a time; names have no leading slash."""

    stamp_s: float
    parent: str
    child: str
    T_parent_child: Float64


def read_transforms(message: bytes) -> Iterator[Transform]:
    """Yield the transforms of a TFMessage that can be used; one that is no pose is left out.

    Raises:
        MessageError: it is not a TFMessage, or ends within a transform.
    """
    cdr = CdrReader(message)
    n = cdr.count()
    if n > MAX_TRANSFORMS:
        raise MessageError("malformed", f"{n} transforms")
    for _ in range(n):
        stamp_s, parent = cdr.header()
        child = cdr.text()
        numbers = cdr.doubles(7)
        with suppress(MessageError):
            yield Transform(stamp_s, parent.lstrip("/"), child.lstrip("/"), pose_of(numbers))


class Transforms:
    """The tree of a robot's frames. A transform that changes is known as one that moves."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Float64]] = {}
        self._moving: set[str] = set()

    def add(self, message: bytes) -> None:
        """Add the transforms of a message.

        Raises:
            MessageError: it is not a TFMessage.
        """
        for transform in read_transforms(message):
            before = self._parents.get(transform.child)
            if before and np.abs(before[1] - transform.T_parent_child).max() > FIXED_M:
                self._moving.add(transform.child)
            self._parents[transform.child] = (transform.parent, transform.T_parent_child)

    def between(self, base: str, sensor: str) -> Float64 | None:
        """(4, 4) pose of `sensor` in `base`; None if no fixed transforms connect them."""
        base_chain = self.chain(base)
        sensor_chain = self.chain(sensor)
        common = next((frame for frame in sensor_chain if frame in base_chain), None)
        if common is None:
            return None
        below = [*base_chain[: base_chain.index(common)], *sensor_chain[: sensor_chain.index(common)]]
        if self._moving.intersection(below):
            return None
        return inverse(self._pose(base_chain, common)) @ self._pose(sensor_chain, common)

    def moves(self, frame: str) -> bool:
        """Whether the transform of a frame into its parent has changed."""
        return frame in self._moving

    def chain(self, frame: str) -> list[str]:
        """A frame and those above it, up to the root."""
        chain = [self._known(frame.lstrip("/"))]
        while chain[-1] in self._parents and len(chain) <= len(self._parents):  # ends if the transforms form a loop
            chain.append(self._parents[chain[-1]][0])
        return chain

    def _known(self, frame: str) -> str:
        """The frame, or the only one that has its name in a namespace, or without that of the frame."""
        names = self._parents.keys() | {parent for parent, _ in self._parents.values()}
        alike = {name for name in names if name.rpartition("/")[2] == frame.rpartition("/")[2]}
        alike = {name for name in alike if "/" not in name or "/" not in frame}  # another namespace is another robot
        return alike.pop() if frame not in names and len(alike) == 1 else frame

    def _pose(self, chain: list[str], end: str) -> Float64:
        """(4, 4) pose of the first frame of a chain in another one of it."""
        T: Float64 = np.eye(4)
        for frame in chain[: chain.index(end)]:
            T = self._parents[frame][1] @ T
        return T
