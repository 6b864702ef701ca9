"""The published objects of a frame as messages of ROS 2 that stacks read."""

from __future__ import annotations

from itertools import chain

import numpy as np

from modt.classes import CLASSES, N_CLASSES
from modt.publication import KIND_NAMES, PublishedObjects, published_objects
from modt.ros2.cdr import CdrWriter, header_fields, text_fields
from modt.sinks.poses import box_poses, in_sensor_frame
from modt.types import Float64, FrameResult, MotionState

DETECTIONS = "vision_msgs/Detection3DArray"
TRACKED_OBJECTS = "autoware_perception_msgs/TrackedObjects"
OBSTACLES = "nav2_dynamic_msgs/ObstacleArray"

UNKNOWN = 0
"""Label of autoware_perception_msgs/ObjectClassification of what has no class."""
AUTOWARE_LABELS = tuple(spec.autoware for spec in CLASSES)
"""Such a label of each class."""
# Values of orientation_availability of autoware_perception_msgs/TrackedObjectKinematics
SIGN_UNKNOWN = 1
AVAILABLE = 2
BOUNDING_BOX = 0
"""Type of autoware_perception_msgs/Shape."""
UNIFORM_YAW_RAD2 = np.pi**2 / 3
"""Variance of a heading of which nothing is known."""
NO_ACCELERATION = f"{8 * (6 + 36)}x"
"""Field of a geometry_msgs/AccelWithCovariance of zeros."""


def detections(result: FrameResult, frame_id: str, background: bool) -> bytes:
    """vision_msgs/Detection3DArray (version 4): whole boxes and posteriors, the reported class first."""
    objects = published_objects(result, background)
    header, header_values = header_fields(result.frame.stamp_s, frame_id)
    layouts = [_detection(header, kind) for kind in range(len(KIND_NAMES))]
    R_level_sensor = result.frame.R_level_sensor
    poses = in_sensor_frame(box_poses(objects.box), R_level_sensor)
    covariance = _pose_covariance(objects, R_level_sensor)
    # Of what moves, and of what may be a person, the score is the probability that it is there at all.
    scores = np.column_stack([objects.posterior, objects.existence, objects.existence])
    cdr = CdrWriter()
    cdr.record((*header, "I"), *header_values, len(objects))
    columns = (objects.id, objects.kind, scores, poses, covariance, objects.box[:, 3:6])
    for track, kind, score, pose, covariance_, size in zip(*(c.tolist() for c in columns), strict=True):
        fields, hypotheses = layouts[kind]
        results = [(*name, score[k], *pose, *covariance_) for k, name in hypotheses]
        cdr.record(fields, *header_values, len(results), *chain.from_iterable(results), *pose, *size)
        cdr.text(str(track))
    return cdr.message()


def _detection(
    header: tuple[str, ...], kind: int
) -> tuple[tuple[str, ...], list[tuple[int, tuple[float | bytes, ...]]]]:
    """Fields of a detection of a kind up to its id, and kind and name of each hypothesis in their order."""
    order = [kind, *(k for k in range(N_CLASSES) if k != kind)]
    names = [(k, text_fields(KIND_NAMES[k])) for k in order]
    results = chain.from_iterable((*fields, "d", "7d", "36d") for _, (fields, _) in names)
    return (*header, "I", *results, "7d", "3d"), [(k, values) for k, (_, values) in names]


def tracked_objects(result: FrameResult, frame_id: str, background: bool) -> bytes:
    """autoware_perception_msgs/TrackedObjects: whole boxes with their velocities, along and across each box."""
    objects = published_objects(result, background)
    R_level_sensor = result.frame.R_level_sensor
    poses = in_sensor_frame(box_poses(objects.box), R_level_sensor)
    twist, twist_covariance = _along_the_box(objects)
    availability = np.where(objects.heading_known, AVAILABLE, SIGN_UNKNOWN)
    columns = (
        objects.id,
        objects.existence,
        objects.posterior,
        poses,
        _pose_covariance(objects, R_level_sensor),
        twist,
        twist_covariance,
        availability,
        objects.motion == MotionState.STILL.value,
        objects.box[:, 3:6],
    )
    classes = ("B", "f") * N_CLASSES
    kinematics = ("7d", "36d", "6d", "36d", NO_ACCELERATION, "B", "?")
    fields = ("16s", "f", "I", *classes, *kinematics, "B", "I", "3d")
    cdr = CdrWriter()
    cdr.header(result.frame.stamp_s, frame_id)
    cdr.record(("I",), len(objects))
    for track, exists, posterior, pose, P, velocity, V, sign, still, size in zip(
        *(c.tolist() for c in columns), strict=True
    ):
        labels = chain.from_iterable(zip(AUTOWARE_LABELS, posterior, strict=True))
        placed = (*pose, *P, *velocity, *V, sign, still)
        no_footprint = 0
        cdr.record(
            fields, uuid(result, track), exists, N_CLASSES, *labels, *placed, BOUNDING_BOX, no_footprint, *size
        )
    return cdr.message()


def obstacles(result: FrameResult, frame_id: str, background: bool) -> bytes:
    """nav2_dynamic_msgs/ObstacleArray: centres, velocities over ground, and sizes along the axes of the frame."""
    objects = published_objects(result, background)
    R_level_sensor = result.frame.R_level_sensor
    poses = in_sensor_frame(box_poses(objects.box), R_level_sensor)
    velocity = objects.velocity @ _axes_in_sensor_frame(R_level_sensor).T
    columns = (objects.id, objects.existence, poses[:, :3], velocity, _enclosing_size(objects.box))
    cdr = CdrWriter()
    cdr.header(result.frame.stamp_s, frame_id)
    cdr.record(("I",), len(objects))
    for track, exists, centre, velocity, size in zip(*(c.tolist() for c in columns), strict=True):
        cdr.record(("16s", "f", "3d", "3d", "3d"), uuid(result, track), exists, *centre, *velocity, *size)
    return cdr.message()


def uuid(result: FrameResult, track: int) -> bytes:
    """The 16 bytes of unique_identifier_msgs/UUID of a track: the identity of the run and the number of the track."""
    return bytes.fromhex(result.run_id).ljust(8, b"\0") + track.to_bytes(8, "big")


def _axes_in_sensor_frame(R_level_sensor: Float64 | None) -> Float64:
    """(3, 2) the horizontal axes of the level frame in that of the sensor as it is mounted, tilted or not."""
    axes = np.eye(3)[:, :2]
    return axes if R_level_sensor is None else R_level_sensor.T @ axes


def _pose_covariance(objects: PublishedObjects, R_level_sensor: Float64 | None) -> Float64:
    """(n, 36) covariance of x, y, z and of the rotations about them; 0 stands for one that is not known."""
    axes = _axes_in_sensor_frame(R_level_sensor)
    covariance = np.zeros((len(objects), 6, 6))
    covariance[:, :3, :3] = axes @ objects.position_covariance @ axes.T
    covariance[:, 5, 5] = np.minimum(objects.heading_variance, UNIFORM_YAW_RAD2)
    return covariance.reshape(-1, 36)


def _along_the_box(objects: PublishedObjects) -> tuple[Float64, Float64]:
    """(n, 6) velocity along and across each box, then zeros, and its (n, 36) covariance."""
    c = np.cos(objects.box[:, 6])
    s = np.sin(objects.box[:, 6])
    R_box_level = np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
    twist = np.zeros((len(objects), 6))
    twist[:, :2] = (R_box_level @ objects.velocity[:, :, None])[:, :, 0]
    covariance = np.zeros((len(objects), 6, 6))
    covariance[:, :2, :2] = R_box_level @ objects.velocity_covariance @ R_box_level.transpose(0, 2, 1)
    return twist, covariance.reshape(-1, 36)


def _enclosing_size(box: Float64) -> Float64:
    """(n, 3) size of boxes (n, 7) along the axes of their frame."""
    c = np.abs(np.cos(box[:, 6]))
    s = np.abs(np.sin(box[:, 6]))
    length = box[:, 3]
    width = box[:, 4]
    return np.column_stack([c * length + s * width, s * length + c * width, box[:, 5]])
