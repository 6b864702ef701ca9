"""tf2_msgs/TFMessage: the pose of the sensor in the world."""

from __future__ import annotations

import numpy as np

from modt.geometry import quaternion_of, se3
from modt.ros2 import static_transforms
from modt.ros2.cdr import CdrWriter
from modt.types import FrameResult

TOPIC, TYPE = "/tf", static_transforms.TYPE


def encode(result: FrameResult, frame_id: str, world_frame_id: str) -> bytes:
    """Transform from the frame of the sensor to that of the world, its parent."""
    T, R_level_sensor = result.T_world_sensor, result.frame.R_level_sensor
    if R_level_sensor is not None:
        T = T @ se3(R_level_sensor, np.zeros(3))
    cdr = CdrWriter()
    cdr.record(("I",), 1)
    cdr.header(result.frame.stamp_s, world_frame_id)
    cdr.text(frame_id)
    cdr.record(("7d",), *T[:3, 3].tolist(), *quaternion_of(T).tolist())
    return cdr.message()
