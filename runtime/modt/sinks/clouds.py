"""Points of a frame as point clouds of ROS 2."""

from __future__ import annotations

import numpy as np

from modt.ros2 import point_cloud2
from modt.ros2.cdr import INT32_MAX
from modt.types import Float32, FrameResult, Int, PointKind

LABELLED = np.dtype(
    {
        "names": ["x", "y", "z", "track", "class"],
        "formats": ["<f4", "<f4", "<f4", "<i4", "u1"],
        "offsets": [0, 4, 8, 12, 16],
        "itemsize": 20,
    }
)
"""A point of an obstacle or of the ground. `track` is its label, `class` the reported class of its track."""


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
    points["track"] = np.where(label >= 0, label & INT32_MAX, label)  # the field has 31 bits
    has_track = label >= 0
    by_id = np.argsort(result.tracks.id)
    track = by_id[np.searchsorted(result.tracks.id, label[has_track], sorter=by_id)]
    points["class"][has_track] = result.tracks.object_class[track]
    return point_cloud2.write_table(result.frame.stamp_s, frame_id, points)


def _turned_back(xyz: Float32, result: FrameResult) -> Float32:
    """(K, 3) points turned from the level frame into that of the sensor, as mounted on the robot."""
    R_level_sensor = result.frame.R_level_sensor
    return xyz if R_level_sensor is None else xyz @ R_level_sensor.astype(np.float32)
