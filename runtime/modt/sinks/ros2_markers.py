"""visualization_msgs/MarkerArray: a cube and a label for each object that is seen."""

from __future__ import annotations

import numpy as np

from modt.classes import CLASS_NAMES, CLASSES, ObjectClass
from modt.ros2.cdr import CdrWriter
from modt.sinks.ros2_detections import box_poses
from modt.types import NONE, FrameResult

TYPE = "visualization_msgs/MarkerArray"
CUBE, TEXT = 1, 9
ADD, DELETE_ALL = 0, 3
LIFETIME_S = 1
"""Time after which a marker goes that no frame has replaced."""
TEXT_M, ABOVE_M = 0.6, 0.5
"""Height of a label, and of its middle above the box."""
WHITE = (1.0, 1.0, 1.0, 1.0)
NOWHERE, NO_SIZE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def _rgba(colour: str) -> tuple[float, ...]:
    return (*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), 0.6)


COLOURS = tuple(_rgba(spec.colour) for spec in CLASSES.values())


class _Markers:
    """Markers of a frame, encoded one by one."""

    def __init__(self, count: int, stamp_s: float, frame_id: str) -> None:
        self.cdr, self._stamp_s, self._frame_id = CdrWriter(), stamp_s, frame_id
        self.cdr.numbers("I", count)

    def add(
        self,
        namespace: str,
        number: int,
        kind: int,
        action: int,
        pose: tuple[float, ...] = NOWHERE,
        scale: tuple[float, ...] = NO_SIZE,
        colour: tuple[float, ...] = WHITE,
        text: str = "",
    ) -> None:
        """Append a marker."""
        cdr = self.cdr
        cdr.header(self._stamp_s, self._frame_id)
        cdr.text(namespace)
        cdr.numbers("i", number, kind, action)
        cdr.numbers("d", *pose, *scale)
        cdr.numbers("f", *colour)
        cdr.numbers("i", LIFETIME_S, 0)
        cdr.numbers("B", 0)  # frame_locked
        cdr.numbers("I", 0, 0)  # points, colors
        cdr.text("")  # texture_resource
        cdr.header(0.0, "")  # texture
        cdr.text("")
        cdr.numbers("I", 0, 0)  # its data, and uv_coordinates
        cdr.text(text)
        cdr.text("")  # mesh_resource
        cdr.text("")  # mesh_file
        cdr.numbers("I", 0)
        cdr.numbers("B", 0)  # mesh_use_embedded_materials


def encode(result: FrameResult, frame_id: str) -> bytes:
    """A cube and a label for every track with a proposal that is said to be an object; those before are deleted."""
    tracks = result.tracks
    rows = np.flatnonzero((tracks.proposal != NONE) & (tracks.object_class != ObjectClass.BACKGROUND))
    boxes = result.proposals.box[tracks.proposal[rows]]
    markers = _Markers(1 + 2 * len(rows), result.frame.stamp_s, frame_id)
    markers.add("", 0, CUBE, DELETE_ALL)
    poses, sizes = box_poses(boxes), boxes[:, 3:6]
    above = poses + np.array([0, 0, 1, 0, 0, 0, 0]) * (sizes[:, 2:] / 2 + ABOVE_M)
    columns = (tracks.id[rows], tracks.object_class[rows], tracks.x[rows, 3], poses, sizes, above)
    for track, class_, speed_mps, pose, size, top in zip(*(column.tolist() for column in columns), strict=True):
        label = f"{CLASS_NAMES[class_]} {track}, {abs(speed_mps):.1f} m/s"
        markers.add("objects", track, CUBE, ADD, pose, size, COLOURS[class_])
        markers.add("labels", track, TEXT, ADD, top, (0.0, 0.0, TEXT_M), WHITE, label)
    return markers.cdr.message()
