"""Labelled scans of KITTI (object, raw, odometry) and Argoverse 2 in one form."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from modt.classes import CLASSES, ObjectClass, class_of_kitti
from modt.evaluation import overlap
from modt.evaluation.truth import Regions
from modt.geometry import FieldOfView
from modt.sources.kitti_calibration import camera_of_raw, camera_of_sequence
from modt.sources.kitti_labels import DONT_CARE, read_labels, read_tracklets
from modt.types import Bool, Float32, Float64, Int

SEMANTIC_CLASS = {label: c for c, spec in CLASSES.items() for label in spec.semantic_kitti} | dict.fromkeys(
    (18, 258), ObjectClass.BACKGROUND
)
"""Trucks are labelled objects of no class."""
SEMANTIC_UNKNOWN = (0, 1, 13, 15, 16, 20, 32, 99, 255, 256, 257, 259)
"""Labels without a known class: unlabelled, and vehicles that KITTI's object labels classify differently."""
ARGOVERSE_CLASS = {"REGULAR_VEHICLE": "Car", "PEDESTRIAN": "Pedestrian", "BICYCLIST": "Cyclist"}
ARGOVERSE_SENSOR_M = np.array([1.35, 0.0, 1.4], np.float32)
"""Sensor position in the vehicle frame: at the heads, at the height above the ground of KITTI's sensor."""
ARGOVERSE_EGO_VEHICLE_M = 2.5
"""Radius of the returns from the carrying vehicle."""
TEST_DRIVE = "2011_09_26_drive_0005_sync"


@dataclass(frozen=True)
class Scan:
    """A scan and its labels.

    Attributes:
        name: of the scan.
        drive: its recording; the unit of the split into training and validation.
        points: (N, 4) sensor frame.
        objects: point indices of each of the B labelled objects.
        kinds: class of each, BACKGROUND for other labelled types.
        boxes: (B, 7) x, y, z of the centre of the bottom face, l, w, h, yaw, sensor frame; NaN where unknown.
        fov: region with complete labels.
        unlabelled: (N,) points without a label.
        track_ids: of each object, constant over a drive; empty where not labelled.
    """

    name: str
    drive: str
    points: Float32
    objects: tuple[Int, ...]
    kinds: tuple[ObjectClass, ...]
    boxes: Float64
    fov: FieldOfView
    unlabelled: Bool
    track_ids: tuple[int, ...] = ()


def points_in_box(points: Float32, box: Float64) -> Bool:
    """(N,) points of the object in a box: a little beyond its faces, and clear of the ground."""
    return overlap.inside(points, centred(box))


def centred(boxes: Float64) -> Float64:
    """(..., 7) boxes about their centres, of boxes about the centres of their bottom faces."""
    out = boxes.copy()
    out[..., 2] += boxes[..., 5] / 2
    return out


def on_bottom(boxes: Float64) -> Float64:
    """(..., 7) boxes about the centres of their bottom faces, of boxes about their centres."""
    out = boxes.copy()
    out[..., 2] -= boxes[..., 5] / 2
    return out


def scan_from_boxes(
    name: str,
    drive: str,
    points: Float32,
    boxes: list[list[float]],
    kinds: list[str],
    fov: FieldOfView,
    unlabelled: Bool,
) -> Scan:
    """A scan with the points of each object taken from its box."""
    table = np.array(boxes).reshape(-1, 7)
    objects = tuple(np.flatnonzero(points_in_box(points, box)) for box in table)
    classes = tuple(class_of_kitti(kind) for kind in kinds)
    return Scan(name, drive, points, objects, classes, table, fov, unlabelled | ~fov.contains(points))


def object_scans(folder: Path) -> Iterator[Scan]:
    """Scans of the KITTI object benchmark: folder/velodyne*, folder/label_2, folder/calib."""
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
    boxes, kinds = [on_bottom(item.box).tolist() for item in objects], [item.type_ for item in objects]
    return scan_from_boxes(path.stem, drive, points, boxes, kinds, FieldOfView.of_camera(camera), unlabelled)


def raw_scans(drive: Path, *, confirm: bool = False) -> Iterator[Scan]:
    """Scans of a KITTI raw drive with tracklets; of the test drive only with `confirm`."""
    assert confirm or drive.name != TEST_DRIVE, drive
    camera = camera_of_raw(drive.parent / "calib_cam_to_cam.txt")
    tracklets = read_tracklets(drive / "tracklet_labels.xml")
    for path in sorted((drive / "velodyne_points" / "data").glob("*.bin")):
        frame = int(path.stem)
        present = [label for label in tracklets if label.frame == frame]
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        boxes, kinds = [on_bottom(label.box).tolist() for label in present], [label.type_ for label in present]
        name, fov = f"{drive.name}/{path.stem}", FieldOfView.of_camera(camera)
        scan = scan_from_boxes(name, drive.name, points, boxes, kinds, fov, np.zeros(len(points), np.bool_))
        yield replace(scan, track_ids=tuple(label.id for label in present))


def semantic_scans(folder: Path) -> Iterator[Scan]:
    """Scans with SemanticKITTI labels over the full circle: folder/*/velodyne, folder/*/labels."""
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
    """Sweeps of Argoverse 2 (two heads of 32 beams), labelled over the full circle: folder/*.npz, folder/*.csv.

    Their origin, the rear axle, is moved to ARGOVERSE_SENSOR_M.
    """
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as file:
            points = file["points"].astype(np.float32)
        points[:, :3] -= ARGOVERSE_SENSOR_M
        points[:, 3] = 0.0  # on another scale
        points = points[np.hypot(points[:, 0], points[:, 1]) > ARGOVERSE_EGO_VEHICLE_M]
        with path.with_suffix(".csv").open(encoding="utf-8") as rows:
            objects = [row for row in csv.DictReader(rows) if int(row["points"]) > 0]
        columns = ("x_m", "y_m", "z_centre_m", "length_m", "width_m", "height_m", "yaw_rad")
        boxes = np.array([[float(row[c]) for c in columns] for row in objects])
        boxes[:, :3] -= ARGOVERSE_SENSOR_M
        boxes[:, 2] -= boxes[:, 5] / 2
        kinds = [ARGOVERSE_CLASS.get(row["category"], "") for row in objects]
        drive = f"argoverse2/{path.stem.split('_')[0]}"
        none = np.zeros(len(points), np.bool_)
        yield scan_from_boxes(f"argoverse2/{path.stem}", drive, points, boxes.tolist(), kinds, FieldOfView(), none)
