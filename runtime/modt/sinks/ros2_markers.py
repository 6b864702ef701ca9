"""visualization_msgs/MarkerArray: a cube and a label for each object that is seen."""

from __future__ import annotations

import numpy as np

from modt.classes import CLASS_NAMES, CLASSES
from modt.ros2.cdr import CdrWriter, Fields, header_fields, text_fields
from modt.sinks.ros2_detections import box_poses, in_sensor_frame, seen
from modt.types import FrameResult

TYPE = "visualization_msgs/MarkerArray"
CUBE, TEXT = 1, 9
ADD, DELETE_ALL = 0, 3
LIFETIME_S = 1
"""Time after which a marker goes that no frame has replaced."""
TEXT_M, ABOVE_M = 0.6, 0.5
"""Height of a label, and of its middle above the box."""
WHITE = (1.0, 1.0, 1.0, 1.0)
NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Pose and scale of a marker that is none."""
NO_TEXT, NO_HEADER = text_fields(""), header_fields(0.0, "")
UNUSED: Fields = (
    ("B", "2I", *NO_TEXT[0], *NO_HEADER[0], *NO_TEXT[0], "2I"),
    (0, 0, 0, *NO_TEXT[1], *NO_HEADER[1], *NO_TEXT[1], 0, 0),
)
"""frame_locked, points, colors, texture_resource, texture (header, format, data), uv_coordinates."""
NO_MESH: Fields = ((*NO_TEXT[0], *NO_TEXT[0], "I", "B"), (*NO_TEXT[1], *NO_TEXT[1], 0, 0))
"""mesh_resource, mesh_file (filename, data), mesh_use_embedded_materials."""


def _rgba(colour: str) -> tuple[float, ...]:
    return (*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), 0.6)


COLOURS = tuple(_rgba(spec.colour) for spec in CLASSES.values())


def encode(result: FrameResult, frame_id: str) -> bytes:
    """A cube and a label for every track with a proposal that is said to be an object; those before are deleted."""
    tracks, rows = result.tracks, seen(result)
    boxes = result.proposals.box[tracks.proposal[rows]]
    header = header_fields(result.frame.stamp_s, frame_id)
    cdr = CdrWriter()
    cdr.record(("I",), 1 + 2 * len(rows))
    _add(cdr, header, "", (0, CUBE, DELETE_ALL), NOWHERE)
    poses, sizes = box_poses(boxes), boxes[:, 3:6]
    above = poses + np.array([0, 0, 1, 0, 0, 0, 0]) * (sizes[:, 2:] / 2 + ABOVE_M)
    poses, above = (in_sensor_frame(at, result.frame.R_level_sensor) for at in (poses, above))
    columns = (tracks.id[rows], tracks.object_class[rows], tracks.x[rows, 3], poses, sizes, above)
    for track, class_, speed_mps, pose, size, top in zip(*(column.tolist() for column in columns), strict=True):
        label = f"{CLASS_NAMES[class_]} {track}, {abs(speed_mps):.1f} m/s"
        _add(cdr, header, "objects", (track, CUBE, ADD), (*pose, *size), COLOURS[class_])
        _add(cdr, header, "labels", (track, TEXT, ADD), (*top, 0.0, 0.0, TEXT_M), WHITE, label)
    return cdr.message()


def _add(
    cdr: CdrWriter,
    header: Fields,
    namespace: str,
    number_kind_action: tuple[int, int, int],
    pose_scale: tuple[float, ...],
    colour: tuple[float, ...] = WHITE,
    text: str = "",
) -> None:
    """Append a marker."""
    name, label = text_fields(namespace), text_fields(text)
    fields = (*header[0], *name[0], "3i", "10d", "4f", "2i", *UNUSED[0], *label[0], *NO_MESH[0])
    first = (*header[1], *name[1], *number_kind_action, *pose_scale, *colour, LIFETIME_S, 0)
    cdr.record(fields, *first, *UNUSED[1], *label[1], *NO_MESH[1])
