"""Truth of a recording: the labelled objects of each frame, and regions without labels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modt.classes import CLASSES, ObjectClass
from modt.geometry import Camera, inverse, transform_boxes
from modt.sources.scan_file import ScanStream
from modt.types import NONE, Bool, Float32, Float64, Int
from modt_evaluation.kitti_labels import Label
from modt_evaluation.rules import Rules

STILL_M = 1.0
"""Size of the square within which the centre of a parked car stays."""
LEAST_FRAMES = 3
"""Least number of labelled frames by which a car is known to be parked."""


class Role(IntEnum):
    """The judgements that a labelled type takes part in."""

    COUNTED = 0
    NEUTRAL = 1
    """Must be segmented and followed. Its class is free: it counts neither as an object nor as a false one."""
    IGNORED = 2
    """Need not be detected, and a detection of it is not false."""
    FURTHER = 3
    """Added beside the labels: counted for its class alone, neither to be segmented nor followed."""


CLASSIFIED = (Role.COUNTED, Role.FURTHER)
"""Roles of objects that are judged for their class."""
LABELLED = (Role.COUNTED, Role.NEUTRAL)
"""Roles of objects that are to be segmented and followed."""


Types = Mapping[str, tuple[int, Role]]
"""Class and role of each labelled type; any other one is background, judged for segmentation alone."""

KITTI_TYPES: Types = {name: (c, Role.COUNTED) for c, spec in enumerate(CLASSES) for name in spec.kitti}
PAPER_TYPES: Types = {
    name: (c, Role.COUNTED if name == CLASSES[c].kitti[0] else Role.IGNORED) for name, (c, _) in KITTI_TYPES.items()
}
"""Table III counts Car, Pedestrian and Cyclist only."""
LABELLED_TYPES: Types = {
    name: (c, Role.COUNTED) for c, spec in enumerate(CLASSES) for name in (*spec.kitti, *spec.labels)
}
"""The names of the classes in all data sets. They are spelt differently, and so contradict one another in none."""
LARGE = "Medium-sized Truck", "Semi-truck", "Bus", "Towed Object", "Other Vehicle - Construction Vehicle"
PANDASET_TYPES: Types = {**dict.fromkeys(LARGE, (ObjectClass.CAR, Role.NEUTRAL)), **LABELLED_TYPES}


@dataclass(frozen=True)
class Regions:
    """Image regions in which nothing is labelled (KITTI's DontCare)."""

    edges: Float64  # (r, 4) left, top, right, bottom [pixel]
    camera: Camera

    def contains(self, points: Float32) -> Bool:
        """(N,) whether each of (N, 4) points is seen in one of them."""
        P = self.camera.P_image_sensor
        uvw = points[:, :3] @ P[:, :3].T + P[:, 3]
        uv = uvw[:, :2] / np.maximum(uvw[:, 2:], 1e-6)
        within = ((uv > self.edges[:, None, :2]) & (uv < self.edges[:, None, 2:])).all(axis=2)
        return np.asarray(within.any(axis=0) & (uvw[:, 2] > 1))


@dataclass(frozen=True)
class FrameTruth:
    """The n objects of one frame; boxes are upright in a frame of their own, the sensor's by default."""

    id: Int  # (n,) NONE where objects are not followed
    type_: Sequence[str]  # (n,) as labelled
    object_class: Int  # (n,) true class of each
    role: Int  # (n,) `Role`
    box: Float64  # (n, 7) x, y, z of the centre, l, w, h [m], yaw [rad]
    parked: Float64 = field(default_factory=lambda: np.zeros((0, 7)))  # (k, 7) parked cars that are not labelled here
    regions: Regions | None = None  # image regions without labels, None for none
    T_box_sensor: Float64 = field(default_factory=lambda: np.eye(4))

    @property
    def range_m(self) -> Float64:
        """(n,) horizontal distance of each from the sensor [m]."""
        return np.asarray(np.hypot(*(self.box[:, :2] - self.T_box_sensor[:2, 3]).T))

    @classmethod
    def of(cls, types: Types, id_: Sequence[int], type_: Sequence[str], box: ArrayLike, **more: Any) -> FrameTruth:
        """Make objects from their labelled types and boxes; `more` sets fields that have a default."""
        table = np.array([types.get(name, (0, Role.COUNTED)) for name in type_], np.int64).reshape(-1, 2)
        boxes = np.asarray(box, np.float64).reshape(-1, 7)
        return cls(np.asarray(id_, np.int64), tuple(type_), table[:, 0], table[:, 1], boxes, **more)


@dataclass(frozen=True)
class Truth:
    """The labels of a recording."""

    frames: Mapping[int, FrameTruth]  # truth of each labelled frame, by its index
    scans: ScanStream | None  # the recording itself, None if it cannot be found
    rules: Rules  # rules of its evaluation
    key_frames: bool = False  # whether some frames have no labels, and are not judged


def parked_outside(labels: Iterable[Label], types: Types, poses: Mapping[int, Float64]) -> dict[int, Float64]:
    """Map each frame to (k, 7) boxes of parked cars without a label in it, as they stood at their nearest label.

    Args:
        labels: labels of a recording.
        types: classes of their types.
        poses: T_world_sensor by frame.
    """
    cars: dict[int, dict[int, Float64]] = {}
    for label in labels:
        if types.get(label.type_, (None,))[0] == ObjectClass.CAR and label.frame in poses:
            placed = transform_boxes(poses[label.frame], label.box[None])
            cars.setdefault(label.id, {})[label.frame] = placed[0]
    found: dict[int, list[Float64]] = {}
    for boxes in cars.values():
        if len(boxes) < LEAST_FRAMES or np.ptp([box[:2] for box in boxes.values()], axis=0).max() > STILL_M:
            continue
        for frame in poses.keys() - boxes.keys():
            nearest = boxes[min(boxes, key=lambda labelled: abs(labelled - frame))]
            found.setdefault(frame, []).append(transform_boxes(inverse(poses[frame]), nearest[None])[0])
    return {frame: np.array(boxes) for frame, boxes in found.items()}


def by_stamp(truth: Truth, stamps_s: Mapping[int, float]) -> Truth:
    """Each frame of a run has the labels and the scan of the nearest stamp, less than half a period away.

    Where no stamps agree, those of the run have another origin: then both count from the first one.

    Args:
        truth: truth of a recording; without scans it is returned unchanged.
        stamps_s: stamp of each frame of the run by its number; at least one.
    """
    if truth.scans is None or not truth.scans.scans:
        return truth
    scans = truth.scans.scans
    info = truth.scans.info
    run_s = np.array([*stamps_s.values()])
    scans_s = np.array([scan.stamp_s for scan in scans])
    nearest = _nearest(scans_s, run_s, info.period_s / 2)
    if (nearest == NONE).all():
        nearest = _nearest(scans_s - scans_s[0], run_s - run_s[0], info.period_s / 2)
    scan_of = {number: scans[k] for number, k in zip(stamps_s, nearest.tolist(), strict=True) if k != NONE}
    frames = {number: truth.frames[scan.index] for number, scan in scan_of.items() if scan.index in truth.frames}
    numbered = [replace(scan, index=number) for number, scan in scan_of.items()]
    return replace(truth, frames=frames, scans=ScanStream(info, numbered))


def _nearest(stamps_s: Float64, wanted_s: Float64, within_s: float) -> Int:
    """(n,) index of the nearest of ascending stamps to each wanted one, NONE where none is near enough."""
    middles_s = (stamps_s[1:] + stamps_s[:-1]) / 2
    place = np.searchsorted(middles_s, wanted_s)
    return np.where(np.abs(stamps_s[place] - wanted_s) < within_s, place, NONE)
