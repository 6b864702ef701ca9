"""Labelled scans, the crops' origin."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from modt import profile
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.types import Bool, Float32, Float64, Int
from modt_evaluation import overlap


@dataclass(frozen=True)
class Scan:
    """A scan and its labels.

    Attributes:
        name: name of the scan.
        drive: its recording; the unit of the split into training and validation.
        points: (N, 4) sensor frame.
        objects: point indices of each of the B labelled objects.
        kinds: class of each, BACKGROUND for other labelled types.
        boxes: (B, 7) x, y, z of the centre of the bottom face, l, w, h, yaw, sensor frame; NaN where unknown. For a
            tilted sensor, whose points are turned level, they stay in the frame of the sensor as it is mounted.
        fov: region with complete labels.
        unlabelled: (N,) points without a label.
        sensor: name of the sensor, by which results are grouped.
        profile: profile of the sensor.
    """

    name: str
    drive: str
    points: Float32
    objects: tuple[Int, ...]
    kinds: tuple[int, ...]
    boxes: Float64
    fov: FieldOfView
    unlabelled: Bool
    sensor: str = profile.DEFAULT
    profile: ProfileConfig = field(default_factory=profile.load)

    def only(self, kept: Bool) -> Scan:
        """The scan with the points of a mask (N,) alone."""
        row = np.cumsum(kept) - 1
        objects = tuple(row[members[kept[members]]] for members in self.objects)
        return replace(self, points=self.points[kept], objects=objects, unlabelled=self.unlabelled[kept])


def points_in_box(points: Float32, box: Float64) -> Bool:
    """(N,) points of the object in a box: a little beyond its faces, and clear of the ground."""
    return overlap.inside(points, box + np.eye(7)[2] * box[5] / 2)


def on_bottom(boxes: Float64) -> Float64:
    """(..., 7) boxes by the centres of their bottom faces, from boxes by their centres."""
    out = boxes.copy()
    out[..., 2] -= boxes[..., 5] / 2
    return out


def scan_from_boxes(
    name: str,
    drive: str,
    points: Float32,
    boxes: Float64,
    kinds: list[int],
    fov: FieldOfView,
    unlabelled: Bool,
) -> Scan:
    """A scan with the points of each object taken from its box."""
    objects = tuple(np.flatnonzero(points_in_box(points, box)) for box in boxes)
    return Scan(name, drive, points, objects, tuple(kinds), boxes, fov, unlabelled | (fov.depth(points) <= 0))
