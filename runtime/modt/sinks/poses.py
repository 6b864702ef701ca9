"""Poses of boxes and of the sensor, and messages of the sensor's pose."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modt.geometry import quaternion_of, se3
from modt.ros2 import odometry
from modt.ros2.cdr import CdrWriter
from modt.types import Float64, FrameResult


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
