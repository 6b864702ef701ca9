"""What is true of a frame: labelled objects, and where nothing is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from modt.evaluation.rules import Rules
from modt.geometry import Camera, inverse, transform_boxes
from modt.sources.kitti_labels import Tracklet
from modt.sources.scan_stream import ScanStream
from modt.types import Bool, Float32, Float64, Int, ObjectClass

STILL_M = 1.0
"""A car whose centre stays within this, in x and in y, is parked."""
LEAST_FRAMES = 3
"""A car labelled in fewer frames is not known to be parked."""


class Role(IntEnum):
    """What a labelled type is judged for."""

    COUNTED = 0
    NEUTRAL = 1
    """To be segmented and followed; its class is free: neither an object for average precision nor a false one."""
    IGNORED = 2
    """Neither to be found nor wrong when found."""


Types = Mapping[str, tuple[ObjectClass, Role]]
"""Class and role of each labelled type; any other one is background, judged for segmentation alone."""

CAR, PEDESTRIAN, CYCLIST = ObjectClass.CAR, ObjectClass.PEDESTRIAN, ObjectClass.CYCLIST
KITTI_TYPES: Types = {
    "Car": (CAR, Role.COUNTED),
    "Van": (CAR, Role.COUNTED),
    "Pedestrian": (PEDESTRIAN, Role.COUNTED),
    "Person": (PEDESTRIAN, Role.COUNTED),
    "Person_sitting": (PEDESTRIAN, Role.COUNTED),
    "Cyclist": (CYCLIST, Role.COUNTED),
}
PAPER_TYPES: Types = {
    name: (class_, Role.COUNTED if name in ("Car", "Pedestrian", "Cyclist") else Role.IGNORED)
    for name, (class_, _) in KITTI_TYPES.items()
}
"""Table III counts Car, Pedestrian and Cyclist only."""
LARGE = (CAR, Role.NEUTRAL)
PANDASET_TYPES: Types = {
    "Car": (CAR, Role.COUNTED),
    "Pickup Truck": (CAR, Role.COUNTED),
    "Medium-sized Truck": LARGE,
    "Semi-truck": LARGE,
    "Bus": LARGE,
    "Towed Object": LARGE,
    "Other Vehicle - Construction Vehicle": LARGE,
    "Pedestrian": (PEDESTRIAN, Role.COUNTED),
    "Pedestrian with Object": (PEDESTRIAN, Role.COUNTED),
    "Motorcycle": (CYCLIST, Role.COUNTED),
    "TYPE_VEHICLE": (CAR, Role.COUNTED),
    "TYPE_PEDESTRIAN": (PEDESTRIAN, Role.COUNTED),
    "TYPE_CYCLIST": (CYCLIST, Role.COUNTED),
}


@dataclass(frozen=True, slots=True)
class Regions:
    """Image regions in which nothing is labelled (KITTI's DontCare).

    Attributes:
        edges: (r, 4) left, top, right, bottom [pixel].
        camera: whose image it is.
    """

    edges: Float64
    camera: Camera

    def contains(self, points: Float32) -> Bool:
        """(N,) whether each of (N, 4) points is seen in one of them."""
        P = self.camera.P_image_sensor
        uvw = points[:, :3] @ P[:, :3].T + P[:, 3]
        uv = uvw[:, :2] / np.maximum(uvw[:, 2:], 1e-6)
        low, high = self.edges[:, None, :2], self.edges[:, None, 2:]
        within: Bool = ((uv > low) & (uv < high)).all(axis=2).any(axis=0) & (uvw[:, 2] > 1)
        return within


def _no_boxes() -> Float64:
    return np.zeros((0, 7))


@dataclass(frozen=True, slots=True)
class FrameTruth:
    """The objects of one frame.

    Attributes:
        id: (n,) identities, NONE where objects are not followed.
        type_: (n,) labelled type of each.
        object_class: (n,) class that it should be said to be.
        role: (n,) `Role` of each.
        box: (n, 7) x, y, z of the centre, l, w, h [m], yaw [rad], upright in the frame of T_box_sensor.
        parked: (k, 7) boxes of parked cars that are not labelled in this frame, the same coordinates.
        regions: where nothing is labelled, None for nowhere.
        T_box_sensor: (4, 4) sensor to box coordinates.
    """

    id: Int
    type_: Sequence[str]
    object_class: Int
    role: Int
    box: Float64
    parked: Float64 = field(default_factory=_no_boxes)
    regions: Regions | None = None
    T_box_sensor: Float64 = field(default_factory=lambda: np.eye(4))

    @classmethod
    def of(
        cls,
        types: Types,
        id_: Sequence[int],
        type_: Sequence[str],
        box: Sequence[Float64] | Float64,
        **more: Float64 | Regions | None,
    ) -> FrameTruth:
        """Truth of labelled types."""
        class_role = [types.get(name, (ObjectClass.BACKGROUND, Role.COUNTED)) for name in type_]
        table = np.array(class_role, np.int64).reshape(-1, 2)
        boxes = np.asarray(box, np.float64).reshape(-1, 7)
        return cls(np.asarray(id_, np.int64), tuple(type_), table[:, 0], table[:, 1], boxes, **more)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Truth:
    """The labels of a recording.

    Attributes:
        frames: of each labelled frame, by its index.
        scans: the recording itself, None where it does not lie beside the labels.
        rules: by which its labels are judged, unless others are given.
    """

    frames: Mapping[int, FrameTruth]
    scans: ScanStream | None
    rules: Rules


def parked_outside(objects: Sequence[Tracklet], types: Types, poses: Mapping[int, Float64]) -> dict[int, Float64]:
    """By frame, (k, 7) boxes of parked cars in the frames that their labels do not cover.

    Args:
        objects: of a recording.
        types: classes of their types.
        poses: T_world_sensor by frame.
    """
    found: dict[int, list[Float64]] = {}
    for item in objects:
        frames_of = range(item.first, item.first + len(item.box))
        posed = [f for f in frames_of if f in poses]
        if types.get(item.type_, (None,))[0] != CAR or len(posed) < LEAST_FRAMES:
            continue
        world = np.concatenate([transform_boxes(poses[f], item.box[f - item.first][None]) for f in posed])
        if np.ptp(world[:, :2], axis=0).max() > STILL_M:
            continue
        for frame, T in poses.items():
            if frame not in frames_of:
                last = world[0] if frame < item.first else world[-1]
                found.setdefault(frame, []).append(transform_boxes(inverse(T), last[None])[0])
    return {frame: np.array(boxes) for frame, boxes in found.items()}
