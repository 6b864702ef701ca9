"""A frame as messages of ROS 2, which the sinks ros2://, mcap:// and foxglove:// publish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.spatial.transform import Rotation

from modt.classes import CLASS_NAMES, CLASSES, ObjectClass
from modt.geometry import quaternion_of, se3, yaw_of
from modt.ros2 import odometry, point_cloud2
from modt.ros2.cdr import CdrWriter, Fields, header_fields, text_fields
from modt.types import NONE, Float32, Float64, FrameResult, Int, PointKind

# Names used if neither the address nor the input gives one
PREFIX = "modt"
FRAME_ID = "lidar"
WORLD_FRAME_ID = "world"

DETECTIONS = "vision_msgs/Detection3DArray"
MARKERS = "visualization_msgs/MarkerArray"
TF = odometry.TF
UNKNOWN_COVARIANCE = f"{8 * 36}x"
"""Field of a covariance of zeros, which stands for an unknown one."""

# Types and actions of visualization_msgs/Marker
ARROW = 0
CUBE = 1
TEXT = 9
ADD = 0
DELETE_ALL = 3

LIFETIME_S = 1
"""Time after which viewers remove a marker that was not replaced [s]."""
TEXT_M = 0.6
"""Height of a label [m]."""
ABOVE_M = 0.5
"""Height of the middle of a label above the box [m]."""
MIN_ARROW_MPS = 0.3
"""Slower objects have no arrow [m/s]. An arrow is as long as the distance of one second."""
ARROW_WIDTH_M = 0.2
WHITE = (1.0, 1.0, 1.0, 1.0)
COLOURS = tuple((*(int(c.colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), 0.6) for c in CLASSES.values())
NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Pose and scale of the marker that deletes all others."""
LABELLED = np.dtype(
    {
        "names": ["x", "y", "z", "track", "class"],
        "formats": ["<f4", "<f4", "<f4", "<i4", "u1"],
        "offsets": [0, 4, 8, 12, 16],
        "itemsize": 20,
    }
)
"""A point of an obstacle or of the ground. `track` is its label, `class` the reported class of its track."""
NO_TEXT = text_fields("")
NO_HEADER = header_fields(0.0, "")


def _joined(*parts: Fields) -> Fields:
    """Fields of several parts as those of one."""
    return tuple(chain.from_iterable(f for f, _ in parts)), tuple(chain.from_iterable(v for _, v in parts))


UNUSED = _joined((("B", "2I"), (0, 0, 0)), NO_TEXT, NO_HEADER, NO_TEXT, (("2I",), (0, 0)))
"""frame_locked, points, colors, texture_resource, texture (header, format, data), uv_coordinates."""
NO_MESH = _joined(NO_TEXT, NO_TEXT, (("I", "B"), (0, 0)))
"""mesh_resource, mesh_file (filename, data), mesh_use_embedded_materials."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic, the type of its messages, and the function that encodes a frame."""

    name: str
    type: str
    encode: Callable[[FrameResult], bytes]


def topics(
    prefix: str = PREFIX,
    *,
    frame_id: str = "",
    world_frame_id: str = "",
    background: bool = False,
    points: bool = False,
    obstacles: bool = False,
) -> list[Topic]:
    """Topics of the results.

    Args:
        prefix: begins the names.
        frame_id: frame of the sensor; "" takes the frame of the input, or FRAME_ID if the input names none.
        world_frame_id: frame of the poses; "" takes WORLD_FRAME_ID, without the topic /tf.
        background: whether detections hold the background too.
        points: whether the sweep is published.
        obstacles: whether the points of obstacles and those of the ground are published.
    """

    def topic(name: str, kind: str, encode: Callable[..., bytes], *more: object) -> Topic:
        return Topic(name, kind, lambda r: encode(r, frame_id or r.frame.frame_id or FRAME_ID, *more))

    made = [
        topic(f"/{prefix}/detections", DETECTIONS, detections, background),
        topic(f"/{prefix}/markers", MARKERS, markers),
        topic(f"/{prefix}/odometry", odometry.TYPE, pose, world_frame_id or WORLD_FRAME_ID),
    ]
    if world_frame_id:
        made.append(topic("/tf", TF, transform, world_frame_id))
    if points:
        made.append(topic(f"/{prefix}/points", point_cloud2.TYPE, cloud))
    if obstacles:
        made.append(topic(f"/{prefix}/obstacles", point_cloud2.TYPE, obstacle_cloud))
        made.append(topic(f"/{prefix}/ground", point_cloud2.TYPE, ground_cloud))
    return made


def seen(result: FrameResult, background: bool = False) -> Int:
    """Rows of the tracks with a proposal, those of the background only if `background`."""
    tracks = result.tracks
    return np.flatnonzero((tracks.proposal != NONE) & (background | (tracks.object_class != ObjectClass.BACKGROUND)))


def detections(result: FrameResult, frame_id: str, background: bool = False) -> bytes:
    """vision_msgs/Detection3DArray (version 4): boxes and posteriors of tracks in view, the reported class first."""
    tracks = result.tracks
    rows = seen(result, background)
    boxes = result.proposals.box[tracks.proposal[rows]]
    poses = in_sensor_frame(box_poses(boxes), result.frame.R_level_sensor)
    header, header_values = header_fields(result.frame.stamp_s, frame_id)
    layouts = [_detection(header, class_) for class_ in range(len(CLASS_NAMES))]
    cdr = CdrWriter()
    cdr.record((*header, "I"), *header_values, len(rows))
    columns = (tracks.id[rows], tracks.object_class[rows], tracks.posterior[rows], poses, boxes[:, 3:6])
    for track, class_, posterior, pose, size in zip(*(column.tolist() for column in columns), strict=True):
        fields, hypotheses = layouts[class_]
        results = [(*name, posterior[k], *pose) for k, name in hypotheses]
        cdr.record(fields, *header_values, len(results), *chain.from_iterable(results), *pose, *size)
        cdr.text(str(track))
    return cdr.message()


def _detection(
    header: tuple[str, ...], class_: int
) -> tuple[tuple[str, ...], list[tuple[int, tuple[float | bytes, ...]]]]:
    """Fields of a detection of a class up to its id, and class and name of each hypothesis in their order."""
    order = [class_, *(k for k in range(len(CLASS_NAMES)) if k != class_)]
    names = [(k, text_fields(CLASS_NAMES[k])) for k in order]
    results = chain.from_iterable((*fields, "d", "7d", UNKNOWN_COVARIANCE) for _, (fields, _) in names)
    return (*header, "I", *results, "7d", "3d"), [(k, values) for k, (_, values) in names]


def markers(result: FrameResult, frame_id: str) -> bytes:
    """visualization_msgs/MarkerArray: a cube, a label and, if it moves, an arrow for each object in view."""
    tracks = result.tracks
    rows = seen(result)
    boxes = result.proposals.box[tracks.proposal[rows]]
    speed = tracks.x[rows, 3]
    # An arrow points where the object goes, which is backwards if its speed is negative.
    ahead = boxes.copy()
    ahead[:, 6] = tracks.x[rows, 2] - yaw_of(result.T_world_sensor) + np.pi * (speed < 0)
    above = box_poses(boxes) + np.array([0, 0, 1, 0, 0, 0, 0]) * (boxes[:, 5:6] / 2 + ABOVE_M)
    poses = (in_sensor_frame(at, result.frame.R_level_sensor) for at in (box_poses(boxes), above, box_poses(ahead)))
    header = header_fields(result.frame.stamp_s, frame_id)
    cdr = CdrWriter()
    cdr.record(("I",), 1 + 2 * len(rows) + int(np.count_nonzero(np.abs(speed) >= MIN_ARROW_MPS)))
    _marker(cdr, header, "", (0, CUBE, DELETE_ALL), NOWHERE)
    columns = (tracks.id[rows], tracks.object_class[rows], np.abs(speed), boxes[:, 3:6], *poses)
    for track, class_, speed_mps, size, pose, top, way in zip(*(column.tolist() for column in columns), strict=True):
        label = f"{CLASS_NAMES[class_]} {track}, {speed_mps:.1f} m/s"
        colour = COLOURS[class_]
        _marker(cdr, header, "objects", (track, CUBE, ADD), (*pose, *size), colour)
        _marker(cdr, header, "labels", (track, TEXT, ADD), (*top, 0.0, 0.0, TEXT_M), WHITE, label)
        if speed_mps >= MIN_ARROW_MPS:
            arrow = (*way, speed_mps, ARROW_WIDTH_M, ARROW_WIDTH_M)
            _marker(cdr, header, "motion", (track, ARROW, ADD), arrow, (*colour[:3], 1.0))
    return cdr.message()


def _marker(
    cdr: CdrWriter,
    header: Fields,
    namespace: str,
    number_kind_action: tuple[int, int, int],
    pose_scale: tuple[float, ...],
    colour: tuple[float, ...] = WHITE,
    text: str = "",
) -> None:
    shape: Fields = ("3i", "10d", "4f", "2i"), (*number_kind_action, *pose_scale, *colour, LIFETIME_S, 0)
    fields, values = _joined(header, text_fields(namespace), shape, UNUSED, text_fields(text), NO_MESH)
    cdr.record(fields, *values)


def pose(result: FrameResult, frame_id: str, world_frame_id: str) -> bytes:
    """nav_msgs/Odometry: the pose of the sensor in the world."""
    return odometry.write_odometry(result.frame.stamp_s, world_frame_id, frame_id, T_world_sensor(result))


def transform(result: FrameResult, frame_id: str, world_frame_id: str) -> bytes:
    """tf2_msgs/TFMessage: the pose of the sensor in the world as a transform."""
    T = T_world_sensor(result)
    cdr = CdrWriter()
    cdr.record(("I",), 1)
    cdr.header(result.frame.stamp_s, world_frame_id)
    cdr.text(frame_id)
    cdr.record(("7d",), *T[:3, 3].tolist(), *quaternion_of(T).tolist())
    return cdr.message()


def cloud(result: FrameResult, frame_id: str) -> bytes:
    """sensor_msgs/PointCloud2: the sweep."""
    points = result.frame.points
    if result.frame.R_level_sensor is not None:
        points = np.column_stack([_turned_back(points[:, :3], result), points[:, 3]])
    return point_cloud2.write_cloud(result.frame.stamp_s, frame_id, points)


def obstacle_cloud(result: FrameResult, frame_id: str) -> bytes:
    """sensor_msgs/PointCloud2: the points that stand above the ground, as LABELLED."""
    return _labelled_cloud(result, frame_id, result.obstacles())


def ground_cloud(result: FrameResult, frame_id: str) -> bytes:
    """sensor_msgs/PointCloud2: the points of the ground, as LABELLED."""
    return _labelled_cloud(result, frame_id, np.flatnonzero(result.labels == PointKind.GROUND.value))


def _labelled_cloud(result: FrameResult, frame_id: str, rows: Int) -> bytes:
    """Message of the points of (K,) rows of the sweep with their labels. A point without a track is background."""
    xyz = _turned_back(result.frame.points.take(rows, axis=0)[:, :3], result)
    label = result.labels.take(rows)
    points = np.zeros(len(rows), LABELLED)
    for k, axis in enumerate("xyz"):
        points[axis] = xyz[:, k]
    points["track"] = label
    has_track = label >= 0
    by_id = np.argsort(result.tracks.id)
    track = by_id[np.searchsorted(result.tracks.id, label[has_track], sorter=by_id)]
    points["class"][has_track] = result.tracks.object_class[track]
    return point_cloud2.write_table(result.frame.stamp_s, frame_id, points)


def _turned_back(xyz: Float32, result: FrameResult) -> Float32:
    """(K, 3) points turned from the level frame into that of the sensor, as mounted on the robot."""
    R_level_sensor = result.frame.R_level_sensor
    return xyz if R_level_sensor is None else xyz @ R_level_sensor.astype(np.float32)


def box_poses(boxes: Float64) -> Float64:
    """(n, 7) positions and quaternions (x, y, z, w) of (n, 7) boxes."""
    half = boxes[:, 6] / 2
    zero = np.zeros(len(boxes))
    return np.column_stack([boxes[:, :3], zero, zero, np.sin(half), np.cos(half)])


def in_sensor_frame(poses: Float64, R_level_sensor: Float64 | None) -> Float64:
    """(n, 7) poses turned from the level frame into that of the tilted sensor, as mounted on the robot."""
    if R_level_sensor is None or not len(poses):
        return poses
    turn = Rotation.from_matrix(R_level_sensor.T)
    turned = turn * Rotation.from_quat(poses[:, 3:])
    return np.column_stack([turn.apply(poses[:, :3]), turned.as_quat()])


def T_world_sensor(result: FrameResult) -> Float64:
    """(4, 4) pose of the sensor as it is mounted, tilted or not."""
    T = result.T_world_sensor
    R_level_sensor = result.frame.R_level_sensor
    return T if R_level_sensor is None else T @ se3(R_level_sensor, np.zeros(3))
