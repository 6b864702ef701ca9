"""ROS 2 messages encoded and decoded by another implementation, `rosbags`."""

from functools import cache

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FURTHER = {
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
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid\n",
    "autoware_perception_msgs/msg/ObjectClassification": "uint8 label\nfloat32 probability\n",
    "autoware_perception_msgs/msg/TrackedObjectKinematics": (
        "geometry_msgs/PoseWithCovariance pose_with_covariance\n"
        "geometry_msgs/TwistWithCovariance twist_with_covariance\n"
        "geometry_msgs/AccelWithCovariance acceleration_with_covariance\n"
        "uint8 orientation_availability\nbool is_stationary\n"
    ),
    "autoware_perception_msgs/msg/Shape": (
        "uint8 type\ngeometry_msgs/Polygon footprint\ngeometry_msgs/Vector3 dimensions\n"
    ),
    "autoware_perception_msgs/msg/TrackedObject": (
        "unique_identifier_msgs/UUID object_id\nfloat32 existence_probability\n"
        "autoware_perception_msgs/ObjectClassification[] classification\n"
        "autoware_perception_msgs/TrackedObjectKinematics kinematics\nautoware_perception_msgs/Shape shape\n"
    ),
    "autoware_perception_msgs/msg/TrackedObjects": (
        "std_msgs/Header header\nautoware_perception_msgs/TrackedObject[] objects\n"
    ),
    "nav2_dynamic_msgs/msg/Obstacle": (
        "unique_identifier_msgs/UUID uuid\nfloat32 score\ngeometry_msgs/Point position\n"
        "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 size\n"
    ),
    "nav2_dynamic_msgs/msg/ObstacleArray": "std_msgs/Header header\nnav2_dynamic_msgs/Obstacle[] obstacles\n",
}
"""Definitions of the packages' .msg files (vision_msgs 4.1, autoware_perception_msgs 1.7), without constants."""


@cache
def store():
    """Types of ROS 2 Humble and of further packages."""
    found = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in FURTHER.items():
        if name not in found.types:
            found.register(get_types_from_msg(definition, name))
    return found


def encode(message, *, little=True):
    """Bytes of a message."""
    return bytes(store().serialize_cdr(message, message.__msgtype__, little_endian=little))


def decode(message, name):
    """Decode bytes that hold one message and at most padding."""
    decoded = store().deserialize_cdr(message, name)
    assert 0 <= len(message) - len(encode(decoded)) < 4
    return decoded


def made(kind, /, **values):
    """A message of a named type, such as `nav_msgs/Odometry`. Fields that are not given are zero or empty.

    A message within it may be given as a dictionary of its fields.
    """
    full = kind.replace("/", "/msg/") if "/msg/" not in kind else kind
    fields = store().fielddefs[full][1]
    return store().types[full](**{name: _value(*form, values.get(name)) for name, form in fields})


def _value(form, of, given):
    if isinstance(given, dict) or (given is None and form.name == "NAME"):
        return made(of, **(given or {}))
    if given is not None:
        return given
    if form.name == "BASE":
        return {"string": "", "bool": False}.get(of[0], 0)
    (kind, (element, *_)), n = of
    return [] if kind.name == "NAME" else np.zeros(n or 0, "u1" if element == "octet" else element)


def header(stamp_s, frame_id):
    seconds, nanoseconds = divmod(round(stamp_s * 1e9), 10**9)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame_id}


def cloud(data, *, stamp_s=1.0, frame_id="lidar", padding=0):
    """A PointCloud2 of a structured (height, width) array, its rows padded by some bytes."""
    kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
    fields = []
    for name, (kind, offset) in data.dtype.fields.items():
        datatype = kinds.get(kind.str[1:], 0)
        fields.append(made("sensor_msgs/PointField", name=name, offset=offset, datatype=datatype, count=1))
    rows = np.frombuffer(data.tobytes(), np.uint8).reshape(len(data), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return made(
        "sensor_msgs/PointCloud2",
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


XYZ = [(axis, "f4") for axis in "xyz"]
XYZI = [*XYZ, ("intensity", "f4")]


def xyzi(n, kind=None):
    """(1, n) points of the common layout."""
    rng = np.random.default_rng(n)
    points = np.zeros((1, n), XYZI if kind is None else kind)
    for name in "xyz":
        points[name] = rng.uniform(-50, 50, n)
    points["intensity"] = rng.uniform(0, 1, n)
    return points


def _named(names, numbers):
    return dict(zip(names, numbers, strict=True))


def odometry(stamp_s, position, quaternion, child="base_link"):
    """An Odometry message."""
    pose = {"pose": {"position": _named("xyz", position), "orientation": _named("xyzw", quaternion)}}
    return made("nav_msgs/Odometry", header=header(stamp_s, "odom"), child_frame_id=child, pose=pose)


def transforms(*edges):
    """A TFMessage of (parent, child, translation, quaternion)."""
    stamped = []
    for parent, child, position, quaternion in edges:
        placed = {"translation": _named("xyz", position), "rotation": _named("xyzw", quaternion)}
        values = {"header": header(0.0, parent), "child_frame_id": child, "transform": placed}
        stamped.append(made("geometry_msgs/TransformStamped", **values))
    return made("tf2_msgs/TFMessage", transforms=stamped)


def single_pose(kind, stamp_s, position, quaternion, child):
    """A PoseStamped, a PoseWithCovarianceStamped or a TransformStamped."""
    if kind == "TransformStamped":
        placed = {"translation": _named("xyz", position), "rotation": _named("xyzw", quaternion)}
        values = {"child_frame_id": child, "transform": placed}
    else:
        placed = {"position": _named("xyz", position), "orientation": _named("xyzw", quaternion)}
        values = {"pose": placed if kind == "PoseStamped" else {"pose": placed}}
    return made(f"geometry_msgs/{kind}", header=header(stamp_s, "map"), **values)


LIVOX_POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line"
LIVOX = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points"
)


def livox(stamp_s, xyz, package):
    """A CustomMsg of points that are seen one after the other over 0.1 s."""
    found = store()
    point = f"{package}/msg/CustomPoint"
    if point not in found.types:
        found.register(get_types_from_msg(LIVOX_POINT, point))
        found.register(get_types_from_msg(LIVOX, f"{package}/msg/CustomMsg"))
    offsets_ns = np.linspace(0, 1e8, len(xyz), endpoint=False).astype(int)
    points = [found.types[point](int(t), *map(float, p), 77, 16, 0) for t, p in zip(offsets_ns, xyz, strict=True)]
    about = {"timebase": round(stamp_s * 1e9), "point_num": len(xyz), "lidar_id": 1, "points": points}
    return encode(made(f"{package}/CustomMsg", header=header(stamp_s, "livox_frame"), **about))
