"""vision_msgs/Detection3DArray of vision_msgs 4 (ROS 2 Humble and later)."""

from __future__ import annotations

import numpy as np

from modt.classes import CLASS_NAMES
from modt.ros2.cdr import CdrWriter
from modt.types import NONE, Float64, FrameResult

TYPE = "vision_msgs/Detection3DArray"
UNKNOWN_COVARIANCE = (0.0,) * 36


def encode(result: FrameResult, frame_id: str) -> bytes:
    """Every track with a proposal, the background too: its box in the frame of the sensor, and its posterior.

    The first hypothesis is the class that is said, the others follow by probability.
    """
    tracks, stamp_s = result.tracks, result.frame.stamp_s
    rows = np.flatnonzero(tracks.proposal != NONE)
    boxes = result.proposals.box[tracks.proposal[rows]]
    posterior, said = tracks.posterior[rows], tracks.object_class[rows]
    rank = posterior.copy()
    rank[np.arange(len(rows)), said] = 2.0
    order = np.argsort(-rank, axis=1, kind="stable")
    cdr = CdrWriter()
    cdr.header(stamp_s, frame_id)
    cdr.numbers("I", len(rows))
    poses = box_poses(boxes).tolist()
    columns = tracks.id[rows].tolist(), order.tolist(), posterior.tolist(), poses, boxes[:, 3:6].tolist()
    for track, classes, probabilities, pose, size in zip(*columns, strict=True):
        cdr.header(stamp_s, frame_id)
        cdr.numbers("I", len(classes))
        for class_ in classes:
            cdr.text(CLASS_NAMES[class_])
            cdr.numbers("d", probabilities[class_], *pose, *UNKNOWN_COVARIANCE)
        cdr.numbers("d", *pose, *size)
        cdr.text(str(track))
    return cdr.message()


def box_poses(boxes: Float64) -> Float64:
    """(n, 7) positions and quaternions (x, y, z, w) of (n, 7) boxes."""
    half = boxes[:, 6] / 2
    zero = np.zeros(len(boxes))
    return np.column_stack([boxes[:, :3], zero, zero, np.sin(half), np.cos(half)])
