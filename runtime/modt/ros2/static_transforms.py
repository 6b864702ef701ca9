"""tf2_msgs/TFMessage of /tf_static: the tree of the robot's fixed frames."""

from __future__ import annotations

import numpy as np

from modt.geometry import inverse
from modt.ros2.cdr import CdrReader, MessageError
from modt.ros2.odometry import read_pose
from modt.types import Float64

TYPE = "tf2_msgs/TFMessage"
TOPIC = "/tf_static"
MAX_TRANSFORMS = 10_000


class StaticTransforms:
    """A tree of frames."""

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
            _, parent, child = cdr.stamp_s(), cdr.text(), cdr.text()
            self._parents[_name(child)] = _name(parent), read_pose(cdr)

    def between(self, base: str, sensor: str) -> Float64 | None:
        """(4, 4) pose of `sensor` in `base`; None if they are not connected."""
        (root, T_root_base), (other, T_other_sensor) = self._root(_name(base)), self._root(_name(sensor))
        return inverse(T_root_base) @ T_other_sensor if root == other else None

    def _root(self, frame: str) -> tuple[str, Float64]:
        """The root of a frame, and the pose of the frame in it."""
        T: Float64 = np.eye(4)
        for _ in range(len(self._parents)):  # ends if the transforms form a loop
            if frame not in self._parents:
                break
            frame, T_parent_frame = self._parents[frame]
            T = T_parent_frame @ T
        return frame, T


def _name(frame: str) -> str:
    return frame.lstrip("/")
