"""KITTI's annotations: tracklets of raw drives, label files of the tracking and the object benchmark."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera, inverse, rotation_zyx, transform, yaw_of
from modt.placement import Mount
from modt.sources.text_file import read_lines
from modt.types import NONE, Float64

DONT_CARE = "DontCare"
REMEDY = "restore the label file"
MAX_FRAME = 100_000
"""Greatest number of a frame."""
MAX_ID = 2**31
MAX_NUMBER = 1e5
"""Greatest number that a label states, of either sign."""


@dataclass(frozen=True)
class Label:
    """An object in a frame."""

    frame: int  # 0 in the object benchmark
    id: int  # NONE in the object benchmark
    type_: str  # as labelled
    box: Float64  # (7,) x, y, z of the centre, l, w, h [m], sensor frame, and yaw [rad] about `up`
    up: Float64 | None = None  # (3,) axis of the height, sensor frame; None for its z axis
    image_box: Float64 | None = None  # (4,) left, top, right, bottom [pixel], None where it is not labelled


def read_tracklets(path: Path) -> list[Label]:
    """The labels of a tracklet_labels.xml; an object's identity is its place in the file.

    Raises:
        MisuseError: it cannot be read, or an item of it is no tracklet; it names the item.
    """
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise MisuseError(path, f"cannot be read ({error})", REMEDY) from None
    labels = []
    for number, item in enumerate(root.iterfind("tracklets/item")):
        try:
            height, width, length = (float(item.findtext(key, "")) for key in "hwl")
            first = int(item.findtext("first_frame", ""))
            type_ = item.findtext("objectType", "")
            for count, pose in enumerate(item.iterfind("poses/item"), first):
                place = np.array([float(pose.findtext(key, "")) for key in ("tx", "ty", "tz", "rz")])
                lean = np.array([float(pose.findtext(key, "0")) for key in ("rx", "ry")])
                frame = _possible(count, number, np.array([*place, *lean, length, width, height]))
                box, up = _tracklet_box(place, lean, (length, width, height))
                labels.append(Label(frame, number, type_, box, up))
        except ValueError:
            raise MisuseError(path, f"item {number} is no tracklet", REMEDY) from None
    return labels


def _tracklet_box(place: Float64, lean: Float64, size: tuple[float, float, float]) -> tuple[Float64, Float64 | None]:
    """The box of a tracklet's pose and its `up`, as in Label.

    Args:
        place: (4,) x, y, z of the foot [m] and turn about z [rad].
        lean: (2,) turns about x and y [rad]. They come before that about z. KITTI's own tracklets have none.
        size: length, width and height [m].
    """
    if not lean.any():
        x, y, foot, yaw = place.tolist()
        return np.array([x, y, foot + size[2] / 2, *size, yaw]), None
    roll, pitch = lean.tolist()
    R_sensor_box = rotation_zyx(roll, pitch, float(place[3]))
    up = R_sensor_box[:, 2]
    yaw = yaw_of(upright(up) @ R_sensor_box)
    centre = place[:3] + up * (size[2] / 2)
    return np.concatenate([centre, size, [yaw]]), up


def upright(up: Float64) -> Float64:
    """(3, 3) R_level_sensor of a sensor in whose frame (3,) is the upward unit vector; its heading stays."""
    R = Mount.upright(up).R_level_sensor
    return np.eye(3) if R is None else R


def read_labels(path: Path, camera: Camera, *, tracking: bool) -> list[Label]:
    """The labels of a file of the tracking or the object benchmark, as the sensor beside the camera sees them.

    Raises:
        MisuseError: it cannot be read, or a line is no label; it names the line.
    """
    T_sensor_camera = inverse(camera.T_camera_sensor)
    labels = []
    for number, line in enumerate(read_lines(path, REMEDY), 1):
        words = line.split()
        try:
            frame, id_ = (int(words.pop(0)), int(words.pop(0))) if tracking else (0, NONE)
            values = np.array(words[1:15], np.float64)
            frame = _possible(frame, id_, values)
            height, width, length, *foot, turn = values[7:].tolist()
            x, y, z = transform(T_sensor_camera, np.array(foot)).tolist()
        except (ValueError, IndexError):
            raise MisuseError(f"{path}:{number}", "no label of KITTI's", REMEDY) from None
        box = np.array([x, y, z + height / 2, length, width, height, -turn - np.pi / 2])
        labels.append(Label(frame, id_, words[0], box, image_box=values[3:7]))
    return labels


def _possible(frame: int, id_: int, values: Float64) -> int:
    """The frame of a label, if its numbers are within their bounds.

    Raises:
        ValueError: a number is out of bounds.
    """
    if frame > MAX_FRAME or abs(id_) > MAX_ID or not (np.abs(values) <= MAX_NUMBER).all():
        raise ValueError(frame)
    return frame
