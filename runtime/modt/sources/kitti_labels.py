"""KITTI's annotations: tracklets of raw drives, label files of the tracking and the object benchmark."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera, inverse, transform, wrap
from modt.types import Float64

DONT_CARE = "DontCare"
REMEDY = "restore the label file"


@dataclass(frozen=True, slots=True)
class Tracklet:
    """An annotated object.

    Attributes:
        type_: as labelled.
        first: frame of its first box.
        box: (m, 7) x, y, z of the centre, l, w, h [m], yaw [rad], sensor frame, frame by frame.
    """

    type_: str
    first: int
    box: Float64


@dataclass(frozen=True, slots=True)
class Label:
    """A line of a label file.

    Attributes:
        frame, id: of the tracking benchmark, 0 and NONE in the object benchmark.
        type_: as labelled.
        image_box: (4,) left, top, right, bottom [pixel].
        hwlxyzry: (7,) size [m], middle of the foot in rectified camera coordinates [m], rotation about y [rad].
    """

    frame: int
    id: int
    type_: str
    image_box: Float64
    hwlxyzry: Float64


def read_tracklets(path: Path) -> list[Tracklet]:
    """The objects of a tracklet_labels.xml.

    Raises:
        MisuseError: it cannot be read, or an item of it is no tracklet.
    """
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise MisuseError(path, f"cannot be read ({error})", REMEDY) from None
    found = []
    for number, item in enumerate(root.iterfind("tracklets/item")):
        try:
            height, width, length = (float(item.findtext(key, "")) for key in "hwl")
            first = int(item.findtext("first_frame", ""))
            keys = ("tx", "ty", "tz", "rz")
            poses = np.array([[float(p.findtext(k, "")) for k in keys] for p in item.iterfind("poses/item")])
        except ValueError:
            raise MisuseError(path, f"item {number} is no tracklet", REMEDY) from None
        x, y, foot, yaw = poses.reshape(-1, 4).T
        size = np.tile([length, width, height], (len(x), 1))
        found.append(
            Tracklet(item.findtext("objectType", ""), first, np.c_[x, y, foot + height / 2, size, wrap(yaw)])
        )
    return found


def read_labels(path: Path, *, tracking: bool) -> list[Label]:
    """The lines of a label file of the tracking or the object benchmark.

    Raises:
        MisuseError: it cannot be read, or a line is no label; it names the line.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", REMEDY) from None
    labels = []
    for number, line in enumerate(lines, 1):
        words = line.split()
        try:
            frame, id_ = (int(words.pop(0)), int(words.pop(0))) if tracking else (0, -1)
            values = np.array([float(word) for word in words[1:15]])
            if len(values) != 14:
                raise ValueError
        except (ValueError, IndexError):
            raise MisuseError(f"{path}:{number}", "no label of KITTI's", REMEDY) from None
        labels.append(Label(frame, id_, words[0], values[3:7], values[7:14]))
    return labels


def boxes(labels: Sequence[Label], camera: Camera) -> Float64:
    """(n, 7) x, y, z of the centre, l, w, h [m], yaw [rad] of labels, sensor frame."""
    table = np.array([label.hwlxyzry for label in labels]).reshape(-1, 7)
    foot = transform(inverse(camera.T_camera_sensor), table[:, 3:6])
    centre = foot + np.array([0, 0, 0.5]) * table[:, :1]
    placed: Float64 = np.c_[centre, table[:, 2::-1], wrap(-table[:, 6] - np.pi / 2)]
    return placed
