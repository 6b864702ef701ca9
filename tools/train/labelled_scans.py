"""Labelled scans: where real objects stand, whatever the format that says so."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from modt.classes import ObjectClass
from modt.evaluation import overlap
from modt.evaluation.truth import Regions
from modt.geometry import FieldOfView
from modt.sources.kitti_calibration import camera_of_raw, camera_of_sequence
from modt.sources.kitti_labels import DONT_CARE, read_labels, read_tracklets
from modt.types import Bool, Float32, Float64, Int

CLASS_OF = {
    "Car": ObjectClass.CAR,
    "Van": ObjectClass.CAR,
    "Pedestrian": ObjectClass.PEDESTRIAN,
    "Person_sitting": ObjectClass.PEDESTRIAN,
    "Cyclist": ObjectClass.CYCLIST,
}
"""Whatever else is labelled counts as background, as in the paper."""
SEMANTIC_CLASS = {
    10: ObjectClass.CAR,
    252: ObjectClass.CAR,
    30: ObjectClass.PEDESTRIAN,
    254: ObjectClass.PEDESTRIAN,
    31: ObjectClass.CYCLIST,
    253: ObjectClass.CYCLIST,
    18: ObjectClass.BACKGROUND,
    258: ObjectClass.BACKGROUND,
}
SEMANTIC_UNKNOWN = (0, 1, 13, 15, 16, 20, 32, 99, 255, 256, 257, 259)
"""Labels that say nothing about the classes: unlabelled, and vehicles that KITTI's object labels name otherwise."""
ARGOVERSE_CLASS = {"REGULAR_VEHICLE": "Car", "PEDESTRIAN": "Pedestrian", "BICYCLIST": "Cyclist"}
ARGOVERSE_SENSOR = np.array([1.35, 0.0, 1.4], np.float32)
"""Where its sweeps get their origin: at the heads, at the height above the ground that KITTI's have."""
ARGOVERSE_CARRIER_M = 2.5
"""Its own car is seen within this."""
TEST_DRIVE = "2011_09_26_drive_0005_sync"


@dataclass(frozen=True)
class Scan:
    """A scan and its labels.

    Attributes:
        name: of the scan.
        drive: recording it is part of; scans of one drive are never split between training and validation.
        points: (N, 4) sensor frame.
        objects: indices of the points that show each labelled object.
        kinds: class of each, BACKGROUND for what is labelled but is none of the classes.
        boxes: (B, 7) x, y, z of the middle of the foot, l, w, h, yaw, sensor frame, of each; NaN where unknown.
        fov: where labels are complete.
        unlabelled: (N,) points of which nothing is known.
        numbers: of each object, the same in every scan of a drive; none where nobody follows them.
    """

    name: str
    drive: str
    points: Float32
    objects: tuple[Int, ...]
    kinds: tuple[ObjectClass, ...]
    boxes: Float64
    fov: FieldOfView
    unlabelled: Bool
    numbers: tuple[int, ...] = ()


def inside(points: Float32, box: Float64) -> Bool:
    """(N,) points of the object in a box on its foot: a little beyond its sides, and clear of the ground."""
    return overlap.inside(points, centred(box))


def centred(boxes: Float64) -> Float64:
    """(..., 7) boxes with the centre in place of the middle of the foot."""
    out = boxes.copy()
    out[..., 2] += boxes[..., 5] / 2
    return out


def footed(boxes: Float64) -> Float64:
    """(..., 7) boxes with the middle of the foot in place of the centre."""
    out = boxes.copy()
    out[..., 2] -= boxes[..., 5] / 2
    return out


def boxed(
    name: str,
    drive: str,
    points: Float32,
    boxes: list[list[float]],
    kinds: list[str],
    fov: FieldOfView,
    unlabelled: Bool,
) -> Scan:
    """A scan whose objects are known by their boxes."""
    table = np.array(boxes).reshape(-1, 7)
    objects = tuple(np.flatnonzero(inside(points, box)) for box in table)
    classes = tuple(CLASS_OF.get(kind, ObjectClass.BACKGROUND) for kind in kinds)
    return Scan(name, drive, points, objects, classes, table, fov, unlabelled | ~fov.contains(points))


def object_scans(folder: Path) -> Iterator[Scan]:
    """Scans of KITTI's object benchmark that lie in a folder with velodyne*/, label_2/ and calib/."""
    table = folder.parent / "training_all_labels" / "frame_to_raw.tsv"
    rows = (line.split("\t") for line in table.read_text(encoding="utf-8").splitlines())
    drive_of = {row[0]: row[2] for row in rows}
    for path in sorted(folder.glob("velodyne*/*.bin"), key=lambda p: p.stem):
        drive = drive_of[path.stem]
        assert drive != TEST_DRIVE, path
        yield object_scan(path, folder / "label_2" / f"{path.stem}.txt", folder / "calib" / f"{path.stem}.txt", drive)


def object_scan(path: Path, label: Path, calib: Path, drive: str) -> Scan:
    """One scan of the object benchmark."""
    camera = camera_of_sequence(calib)
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    labels = read_labels(label, camera, tracking=False)
    objects = [item for item in labels if item.type_ != DONT_CARE]
    edges = np.array([item.image_box for item in labels if item.type_ == DONT_CARE]).reshape(-1, 4)
    unlabelled = Regions(edges, camera).contains(points)
    boxes, kinds = [footed(item.box).tolist() for item in objects], [item.type_ for item in objects]
    return boxed(path.stem, drive, points, boxes, kinds, FieldOfView.of_camera(camera), unlabelled)


def raw_scans(drive: Path, *, confirm: bool = False) -> Iterator[Scan]:
    """Scans of a KITTI raw drive with tracklets; of the test drive only to confirm what was found elsewhere."""
    assert confirm or drive.name != TEST_DRIVE, drive
    camera = camera_of_raw(drive.parent / "calib_cam_to_cam.txt")
    tracklets = read_tracklets(drive / "tracklet_labels.xml")
    for path in sorted((drive / "velodyne_points" / "data").glob("*.bin")):
        frame = int(path.stem)
        here = [label for label in tracklets if label.frame == frame]
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        boxes, kinds = [footed(label.box).tolist() for label in here], [label.type_ for label in here]
        name, fov = f"{drive.name}/{path.stem}", FieldOfView.of_camera(camera)
        scan = boxed(name, drive.name, points, boxes, kinds, fov, np.zeros(len(points), np.bool_))
        yield replace(scan, numbers=tuple(label.id for label in here))


def semantic_scans(folder: Path) -> Iterator[Scan]:
    """Scans with SemanticKITTI labels, all around: folder/*/velodyne, folder/*/labels."""
    for label in sorted(folder.glob("*/labels/*.label")):
        path = label.parents[1] / "velodyne" / f"{label.stem}.bin"
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        semantic, instance = np.divmod(np.fromfile(label, np.uint32).astype(np.int64), 1 << 16)[::-1]
        kinds, objects = [], []
        for number in np.unique(instance[instance > 0] << 16 | semantic[instance > 0]):
            kind = SEMANTIC_CLASS.get(int(number & 0xFFFF))
            own = np.flatnonzero((instance << 16 | semantic) == number)
            if kind is not None:
                kinds.append(kind)
                objects.append(own)
        unknown = np.isin(semantic, SEMANTIC_UNKNOWN)
        name = f"odometry/{label.parents[1].name}/{label.stem}"
        boxes = np.full((len(kinds), 7), np.nan)
        drive = f"odometry/{label.parents[1].name}"
        yield Scan(name, drive, points, tuple(objects), tuple(kinds), boxes, FieldOfView(), unknown)


def argoverse_scans(folder: Path) -> Iterator[Scan]:
    """Sweeps of Argoverse 2 (two heads of 32 beams), labelled all around: folder/*.npz, folder/*.csv.

    Their frame has its origin on the rear axle; the sweeps are moved to where the heads and our own sensor would be.
    """
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as file:
            points = file["points"].astype(np.float32)
        points[:, :3] -= ARGOVERSE_SENSOR
        points[:, 3] = 0.0  # on another scale
        points = points[np.hypot(points[:, 0], points[:, 1]) > ARGOVERSE_CARRIER_M]
        with path.with_suffix(".csv").open(encoding="utf-8") as rows:
            objects = [row for row in csv.DictReader(rows) if int(row["points"]) > 0]
        columns = ("x_m", "y_m", "z_centre_m", "length_m", "width_m", "height_m", "yaw_rad")
        boxes = np.array([[float(row[c]) for c in columns] for row in objects])
        boxes[:, :3] -= ARGOVERSE_SENSOR
        boxes[:, 2] -= boxes[:, 5] / 2
        kinds = [ARGOVERSE_CLASS.get(row["category"], "") for row in objects]
        drive = f"argoverse2/{path.stem.split('_')[0]}"
        none = np.zeros(len(points), np.bool_)
        yield boxed(f"argoverse2/{path.stem}", drive, points, boxes.tolist(), kinds, FieldOfView(), none)
