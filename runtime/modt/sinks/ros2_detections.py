"""vision_msgs/Detection3DArray of vision_msgs 4 (ROS 2 Humble and later)."""

from __future__ import annotations

from itertools import chain

import numpy as np
from scipy.spatial.transform import Rotation

from modt.classes import CLASS_NAMES, ObjectClass
from modt.ros2.cdr import CdrWriter, header_fields, text_fields
from modt.types import NONE, Float64, FrameResult, Int

TYPE = "vision_msgs/Detection3DArray"
UNKNOWN_COVARIANCE = f"{8 * 36}x"


def encode(result: FrameResult, frame_id: str, background: bool = False) -> bytes:
    """Every object with a proposal, on request the background too: its box in the frame of the sensor, and posterior.

    The first hypothesis is the reported class.
    """
    tracks, stamp_s, rows = result.tracks, result.frame.stamp_s, seen(result, background)
    boxes, R_level_sensor = result.proposals.box[tracks.proposal[rows]], result.frame.R_level_sensor
    posterior, said = tracks.posterior[rows], tracks.object_class[rows]
    header, header_values = header_fields(stamp_s, frame_id)
    kinds = [_kind(header, class_) for class_ in range(len(CLASS_NAMES))]
    cdr = CdrWriter()
    cdr.record((*header, "I"), *header_values, len(rows))
    columns = tracks.id[rows], said, posterior, in_sensor_frame(box_poses(boxes), R_level_sensor), boxes[:, 3:6]
    for track, class_, probabilities, pose, size in zip(*(column.tolist() for column in columns), strict=True):
        fields, hypotheses = kinds[class_]
        results = [(*name, probabilities[k], *pose) for k, name in hypotheses]
        cdr.record(fields, *header_values, len(results), *chain.from_iterable(results), *pose, *size)
        cdr.text(str(track))
    return cdr.message()


def seen(result: FrameResult, background: bool = False) -> Int:
    """Rows of the tracks with a proposal that are objects, or with `background` of all."""
    tracks = result.tracks
    return np.flatnonzero((tracks.proposal != NONE) & (background | (tracks.object_class != ObjectClass.BACKGROUND)))


def _kind(header: tuple[str, ...], said: int) -> tuple[tuple[str, ...], list[tuple[int, tuple[float | bytes, ...]]]]:
    """Fields of a detection said to be of a class, up to its id; class and name of each hypothesis in order."""
    order = [said, *(k for k in range(len(CLASS_NAMES)) if k != said)]
    names = [(k, text_fields(CLASS_NAMES[k])) for k in order]
    results = chain.from_iterable((*fields, "d", "7d", UNKNOWN_COVARIANCE) for _, (fields, _) in names)
    return (*header, "I", *results, "7d", "3d"), [(k, values) for k, (_, values) in names]


def box_poses(boxes: Float64) -> Float64:
    """(n, 7) positions and quaternions (x, y, z, w) of (n, 7) boxes."""
    half = boxes[:, 6] / 2
    zero = np.zeros(len(boxes))
    return np.column_stack([boxes[:, :3], zero, zero, np.sin(half), np.cos(half)])


def in_sensor_frame(poses: Float64, R_level_sensor: Float64 | None) -> Float64:
    """(n, 7) poses of the level frame in that of a tilted sensor, which the robot's tree of frames knows."""
    if R_level_sensor is None or not len(poses):
        return poses
    turn = Rotation.from_matrix(R_level_sensor.T)
    turned = turn * Rotation.from_quat(poses[:, 3:])
    return np.column_stack([turn.apply(poses[:, :3]), turned.as_quat()])
