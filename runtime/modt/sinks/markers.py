"""The published objects of a frame as markers for viewers of ROS 2."""

from __future__ import annotations

from itertools import chain

import numpy as np

from modt.publication import KIND_COLOURS, KIND_NAMES, published_objects
from modt.ros2.cdr import INT32_MAX, CdrWriter, Fields, header_fields, text_fields
from modt.sinks.poses import box_poses, in_sensor_frame
from modt.types import FrameResult, MotionState

TYPE = "visualization_msgs/MarkerArray"

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
ARROW_WIDTH_M = 0.2
"""Width of an arrow, which is as long as the way of one second [m]."""
WHITE = (1.0, 1.0, 1.0, 1.0)
COLOURS = tuple((*(int(c[k : k + 2], 16) / 255 for k in (1, 3, 5)), 0.6) for c in KIND_COLOURS)
NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Pose and scale of the marker that deletes all others."""
NO_TEXT = text_fields("")
NO_HEADER = header_fields(0.0, "")


def _joined(*parts: Fields) -> Fields:
    """Fields of several parts as those of one."""
    return tuple(chain.from_iterable(f for f, _ in parts)), tuple(chain.from_iterable(v for _, v in parts))


UNUSED = _joined((("B", "2I"), (0, 0, 0)), NO_TEXT, NO_HEADER, NO_TEXT, (("2I",), (0, 0)))
"""frame_locked, points, colors, texture_resource, texture (header, format, data), uv_coordinates."""
NO_MESH = _joined(NO_TEXT, NO_TEXT, (("I", "B"), (0, 0)))
"""mesh_resource, mesh_file (filename, data), mesh_use_embedded_materials."""


def markers(result: FrameResult, frame_id: str) -> bytes:
    """visualization_msgs/MarkerArray: a cube, a label and, if it moves, an arrow for each published object."""
    objects = published_objects(result)
    boxes = objects.box
    ahead = boxes.copy()
    ahead[:, 6] = np.arctan2(objects.velocity[:, 1], objects.velocity[:, 0])
    speed = np.hypot(objects.velocity[:, 0], objects.velocity[:, 1])
    moving = objects.motion == MotionState.MOVING.value
    above = box_poses(boxes) + np.array([0, 0, 1, 0, 0, 0, 0]) * (boxes[:, 5:6] / 2 + ABOVE_M)
    poses = (in_sensor_frame(at, result.frame.R_level_sensor) for at in (box_poses(boxes), above, box_poses(ahead)))
    header = header_fields(result.frame.stamp_s, frame_id)
    cdr = CdrWriter()
    cdr.record(("I",), 1 + 2 * len(objects) + int(np.count_nonzero(moving)))
    _marker(cdr, header, "", (0, CUBE, DELETE_ALL), NOWHERE)
    numbers = objects.id & INT32_MAX  # a marker has 31 bits for its number
    columns = (numbers, objects.kind, moving, speed, boxes[:, 3:6], *poses)
    for track, kind, moves, speed_mps, size, pose, top, way in zip(*(c.tolist() for c in columns), strict=True):
        label = f"{KIND_NAMES[kind]} {track}, {speed_mps:.1f} m/s"
        colour = COLOURS[kind]
        _marker(cdr, header, "objects", (track, CUBE, ADD), (*pose, *size), colour)
        _marker(cdr, header, "labels", (track, TEXT, ADD), (*top, 0.0, 0.0, TEXT_M), WHITE, label)
        if moves:
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
