"""ROS 2 messages as another implementation, `rosbags`, encodes and decodes them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

VISION_MSGS_4 = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/msg/Detection3D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\n"
        "string id\n"
    ),
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
}
"""Definitions of vision_msgs 4.1, without comments and constants."""


@cache
def store() -> Any:
    """Types of ROS 2 Humble and of vision_msgs 4."""
    typesys = pytest.importorskip("rosbags.typesys")
    found = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, definition in VISION_MSGS_4.items():
        if name not in found.types:
            found.register(typesys.get_types_from_msg(definition, name))
    return found


def encode(message: Any, *, little: bool = True) -> bytes:
    """Bytes of a message."""
    return bytes(store().serialize_cdr(message, message.__msgtype__, little_endian=little))


def decode(message: bytes, name: str) -> Any:
    """The message in bytes that hold nothing else but padding."""
    decoded = store().deserialize_cdr(message, name)
    assert 0 <= len(message) - len(encode(decoded)) < 4
    return decoded


def made(kind: str, /, **values: Any) -> Any:
    """A message of a type, by its short name."""
    return store().types[kind](**values)


def header(stamp_s: float, frame_id: str) -> Any:
    seconds, nanoseconds = divmod(round(stamp_s * 1e9), 10**9)
    stamp = made("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return made("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def cloud(
    data: np.ndarray,
    *,
    stamp_s: float = 1.0,
    frame_id: str = "lidar",
    datatypes: dict[str, int] | None = None,
    padding: int = 0,
) -> Any:
    """A PointCloud2 of a structured (height, width) array, its rows padded by some bytes."""
    kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
    fields = [
        made(
            "sensor_msgs/msg/PointField",
            name=name,
            offset=data.dtype.fields[name][1],
            datatype=(datatypes or {}).get(name, kinds.get(data.dtype.fields[name][0].str[1:], 0)),
            count=1,
        )
        for name in data.dtype.names
    ]
    rows = np.frombuffer(data.tobytes(), np.uint8).reshape(len(data), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return made(
        "sensor_msgs/msg/PointCloud2",
        header=header(stamp_s, frame_id),
        height=data.shape[0],
        width=data.shape[1],
        fields=fields,
        is_bigendian=data.dtype.fields["x"][0].str.startswith(">"),
        point_step=data.dtype.itemsize,
        row_step=rows.shape[1],
        data=rows.reshape(-1),
        is_dense=True,
    )


def xyzi(n: int, kind: Any = None) -> np.ndarray:
    """(1, n) points of the common layout."""
    rng = np.random.default_rng(n)
    layout = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4")] if kind is None else kind
    points = np.zeros((1, n), layout)
    for name in "xyz":
        points[name] = rng.uniform(-50, 50, n)
    points["intensity"] = rng.uniform(0, 1, n)
    return points


def odometry(stamp_s: float, position: list[float], quaternion: list[float], child: str = "base_link") -> Any:
    """An Odometry message."""
    return made(
        "nav_msgs/msg/Odometry",
        header=header(stamp_s, "odom"),
        child_frame_id=child,
        pose=made(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=made(
                "geometry_msgs/msg/Pose",
                position=made("geometry_msgs/msg/Point", **dict(zip("xyz", position, strict=True))),
                orientation=made("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", quaternion, strict=True))),
            ),
            covariance=np.zeros(36),
        ),
        twist=made(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=made(
                "geometry_msgs/msg/Twist",
                linear=made("geometry_msgs/msg/Vector3", x=1.0, y=0.0, z=0.0),
                angular=made("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.1),
            ),
            covariance=np.zeros(36),
        ),
    )


def transforms(*edges: tuple[str, str, list[float], list[float]]) -> Any:
    """A TFMessage of (parent, child, translation, quaternion)."""
    return made(
        "tf2_msgs/msg/TFMessage",
        transforms=[
            made(
                "geometry_msgs/msg/TransformStamped",
                header=header(0.0, parent),
                child_frame_id=child,
                transform=made(
                    "geometry_msgs/msg/Transform",
                    translation=made("geometry_msgs/msg/Vector3", **dict(zip("xyz", at, strict=True))),
                    rotation=made("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turned, strict=True))),
                ),
            )
            for parent, child, at, turned in edges
        ],
    )
