"""Labelled scans of KITTI (object, odometry), Argoverse 2 and PandaSet in one form, each with its sensor."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from modt import profile
from modt.classes import CLASSES, ObjectClass
from modt.config import ProfileConfig, SensorConfig
from modt.errors import MisuseError
from modt.geometry import Camera, FieldOfView
from modt.sources.kitti_calibration import camera_of_sequence
from modt.types import Float32, Float64, Int
from modt_evaluation.kitti_labels import DONT_CARE, read_labels
from modt_evaluation.truth import PANDASET_TYPES, Regions, Role
from modt_training.scan import Scan, on_bottom, points_in_box, scan_from_boxes

KITTI_CLASS = {kind: c for c, spec in enumerate(CLASSES) for kind in spec.kitti}
SEMANTIC_CLASS = {label: c for c, spec in enumerate(CLASSES) for label in spec.semantic_kitti} | dict.fromkeys(
    (18, 258), ObjectClass.BACKGROUND
)
"""Trucks are labelled objects of no class."""
SEMANTIC_UNKNOWN = (0, 1, 13, 15, 16, 20, 32, 99, 255, 256, 257, 259)
"""Labels without a known class: unlabelled, and vehicles that KITTI's object labels classify differently."""
ARGOVERSE_CLASS = {"REGULAR_VEHICLE": "Car", "PEDESTRIAN": "Pedestrian", "BICYCLIST": "Cyclist"}
ARGOVERSE = ProfileConfig(
    sensor=SensorConfig(height_m=1.95, min_range_m=2.5, elevation_step_deg=0.33, azimuth_step_deg=0.2)
)
"""Two heads of 32 beams, one between the beams of the other."""
ARGOVERSE_SENSOR_M = np.array([1.35, 0.0, 1.57], np.float32)
"""Middle between the heads, in the frame of the vehicle."""
PANDAR64 = profile.load("pandar64")
PANDASET_SENSOR_M = {
    "world-000040": (-30.0, 34.1, 1.79),
    "world-000070": (-50.0, 59.3, 1.67),
    "world-000100": (0.57, 0.54, 1.85),
}
"""Middle of the circles on the ground in scans that are not in the frame of the vehicle."""
PANDASET_VEHICLE_SENSOR_M = (0.79, 0.0, 1.85)
PANDASET_DRIVE = dict.fromkeys(("000000", "world-000040", "world-000070"), "000000")
"""Scans of one drive, by the sizes of the objects."""
PANDASET_UNLABELLED = {
    "world-000040": ((10.0, 17.5), (8.7, 17.3)),
    "world-000070": ((26.7, -5.0), (27.9, -4.6)),
}
"""Places x, y [m, sensor frame] of two people without a label, who go 4.1 m from the first scan to the second."""
UNLABELLED_RADIUS_M = 0.7
TURNED_RATIO = 1.5
"""A car's cuboid is turned by a quarter where it then holds so many times the points: in two scans most need it."""
PANDASET_UNKNOWN = (
    "Animals - Other", "Emergency Vehicle", "Motorized Scooter", "Other Vehicle - Pedicab",
    "Personal Mobility Device", "Tram / Subway",
)  # fmt: skip
"""Types that are between the classes."""
TWO_WHEELERS = ("Bicycle", "Motorcycle", "TYPE_CYCLIST")
"""Types of cuboids of both parked and ridden two-wheelers."""
RIDDEN_M = 1.5
"""Height above which a two-wheeler is ridden."""
MISMATCHED = ("002894",)
"""Scans of `training_more` whose labels belong to others: boxes in plain view are empty, and cars have no box."""
THINNED = {2: 0.12, 4: 0.14}
"""Side of a cell at 10 m [m] where every n-th beam of an HDL-64E is kept."""
FULL_SCAN_BEAMS = 64
AT_SENSOR = Camera(np.eye(3, 4), np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]), 1.0, 1.0)
"""Axes of a camera at the sensor."""
TEST_DRIVE = "2011_09_26_drive_0005_sync"


def thinned(scan: Scan, step: int) -> Scan:
    """A scan of an HDL-64E with every step-th beam alone, by the sensor that this would be."""
    config = scan.profile
    sensor = replace(config.sensor, elevation_step_deg=step * config.sensor.elevation_step_deg)
    segmentation = replace(config.segmentation, cell_m=THINNED[step])
    name = f"{scan.sensor}, {FULL_SCAN_BEAMS // step} beams"
    part = scan.only(beams(scan.points) % step == 0)
    return replace(
        part,
        name=f"{scan.name}/{step}",
        sensor=name,
        profile=replace(config, sensor=sensor, segmentation=segmentation),
    )


def beams(points: Float32) -> Int:
    """(N,) beam of each point of KITTI's scans, which are stored beam by beam: the azimuth jumps back between two."""
    azimuth = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
    return np.append(0, np.cumsum(np.diff(azimuth) < -np.pi))


def drives_of_frames(folder: Path) -> dict[str, str]:
    """Raw drive of each frame of the object benchmark, from folder/frame_to_raw.tsv."""
    rows = (line.split("\t") for line in (folder / "frame_to_raw.tsv").read_text(encoding="utf-8").splitlines())
    return {row[0]: row[2] for row in rows}


def object_scans(folder: Path) -> Iterator[Scan]:
    """Scans of the KITTI object benchmark: folder/velodyne*, folder/label_2, folder/calib."""
    drive_of = drives_of_frames(folder.parent / "training_all_labels")
    for path in sorted(folder.glob("velodyne*/*.bin"), key=lambda p: p.stem):
        drive = drive_of[path.stem]
        assert drive != TEST_DRIVE, path
        if path.stem not in MISMATCHED:
            camera = camera_of_sequence(folder / "calib" / f"{path.stem}.txt")
            yield object_scan(path, folder / "label_2" / f"{path.stem}.txt", camera, drive)


def object_scan(path: Path, label: Path, camera: Camera | None, drive: str) -> Scan:
    """One scan of the object benchmark; without a camera its labels are complete over the full circle."""
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    labels = read_labels(label, camera or AT_SENSOR, tracking=False)
    objects = [item for item in labels if item.type_ != DONT_CARE]
    fov = FieldOfView()
    unlabelled = np.zeros(len(points), np.bool_)
    if camera:
        edges = np.array([item.image_box for item in labels if item.type_ == DONT_CARE]).reshape(-1, 4)
        fov = FieldOfView.of_camera(camera)
        unlabelled = Regions(edges, camera).contains(points)
    boxes = on_bottom(np.array([item.box for item in objects]).reshape(-1, 7))
    kinds = [KITTI_CLASS.get(item.type_, ObjectClass.BACKGROUND) for item in objects]
    return scan_from_boxes(path.stem, drive, points, boxes, kinds, fov, unlabelled)


def folder_scans(folder: Path, sensor: str, config: ProfileConfig) -> Iterator[Scan]:
    """Scans in the layout of the KITTI object benchmark: folder/velodyne/*.bin, folder/label_2, folder/calib.

    Without calib/ the labels are complete over the full circle, in a camera frame at the sensor (x right, y down, z
    forward). Scans named DRIVE_NUMBER are of one drive.

    Args:
        folder: folder of the scans.
        sensor: its name.
        config: its profile.

    Raises:
        MisuseError: no scans, or a label or calibration file is missing or invalid.
    """
    paths = sorted((folder / "velodyne").glob("*.bin"))
    if not paths:
        raise MisuseError(folder, "no scans", "give a folder with velodyne/*.bin and label_2/*.txt")
    for path in paths:
        label = folder / "label_2" / f"{path.stem}.txt"
        calib = folder / "calib" / f"{path.stem}.txt"
        drive = path.stem.rpartition("_")[0] or path.stem
        camera = camera_of_sequence(calib) if calib.parent.is_dir() else None
        yield replace(object_scan(path, label, camera, drive), sensor=sensor, profile=config)


def semantic_scans(folder: Path) -> Iterator[Scan]:
    """Scans with SemanticKITTI labels over the full circle: folder/*/velodyne, folder/*/labels."""
    for label in sorted(folder.glob("*/labels/*.label")):
        path = label.parents[1] / "velodyne" / f"{label.stem}.bin"
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        semantic, instance = np.divmod(np.fromfile(label, np.uint32).astype(np.int64), 1 << 16)[::-1]
        kinds = []
        objects = []
        for number in np.unique(instance[instance > 0] << 16 | semantic[instance > 0]):
            kind = SEMANTIC_CLASS.get(int(number & 0xFFFF))
            members = np.flatnonzero((instance << 16 | semantic) == number)
            if kind is not None:
                kinds.append(kind)
                objects.append(members)
        unknown = np.isin(semantic, SEMANTIC_UNKNOWN)
        name = f"odometry/{label.parents[1].name}/{label.stem}"
        boxes = np.full((len(kinds), 7), np.nan)
        drive = f"odometry/{label.parents[1].name}"
        yield Scan(name, drive, points, tuple(objects), tuple(kinds), boxes, FieldOfView(), unknown)


def argoverse_scans(folder: Path) -> Iterator[Scan]:
    """Sweeps of Argoverse 2, labelled over the full circle: folder/*.npz, folder/*.csv."""
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as file:
            points = file["points"].astype(np.float32)
        points[:, :3] -= ARGOVERSE_SENSOR_M
        with path.with_suffix(".csv").open(encoding="utf-8") as rows:
            objects = [row for row in csv.DictReader(rows) if int(row["points"]) > 0]
        columns = ("x_m", "y_m", "z_centre_m", "length_m", "width_m", "height_m", "yaw_rad")
        boxes = on_bottom(np.array([[float(row[c]) for c in columns] for row in objects]))
        boxes[:, :3] -= ARGOVERSE_SENSOR_M
        kinds = [KITTI_CLASS.get(ARGOVERSE_CLASS.get(row["category"], ""), ObjectClass.BACKGROUND) for row in objects]
        drive = f"argoverse2/{path.stem.split('_')[0]}"
        none = np.zeros(len(points), np.bool_)
        scan = scan_from_boxes(f"argoverse2/{path.stem}", drive, points, boxes, kinds, FieldOfView(), none)
        yield replace(scan, sensor="argoverse2", profile=ARGOVERSE)


def pandaset_scans(folder: Path) -> Iterator[Scan]:
    """Scans of PandaSet, labelled over the full circle: folder/scans/*.bin, folder/*.csv.

    Types between the classes, such as lorries, count as unlabelled.
    """
    for path in sorted((folder / "scans").glob("*.bin")):
        position = np.array(PANDASET_SENSOR_M.get(path.stem, PANDASET_VEHICLE_SENSOR_M), np.float32)
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        points[:, :3] -= position
        points[:, 3] /= 255
        with (folder / f"{path.stem}.csv").open(encoding="utf-8") as rows:
            cuboids = list(csv.DictReader(rows))
        columns = ("x", "y", "z", "length", "width", "height", "yaw")
        boxes = on_bottom(np.array([[float(row[c]) for c in columns] for row in cuboids]))
        boxes[:, :3] -= position
        kinds = [_pandaset_class(row["class"], float(row["height"])) for row in cuboids]
        for box, kind in zip(boxes, kinds, strict=True):
            if kind == ObjectClass.CAR:
                box[6] += _turn_rad(points, box)
        known = np.array([kind is not None for kind in kinds])
        unlabelled = np.zeros(len(points), np.bool_)
        for box in boxes[~known]:
            unlabelled |= points_in_box(points, box)
        for x, y in PANDASET_UNLABELLED.get(path.stem, ()):
            unlabelled |= np.hypot(points[:, 0] - x, points[:, 1] - y) < UNLABELLED_RADIUS_M
        drive = f"pandaset/{PANDASET_DRIVE.get(path.stem, path.stem)}"
        classes = [kind for kind in kinds if kind is not None]
        scan = scan_from_boxes(
            f"pandaset/{path.stem}", drive, points, boxes[known], classes, FieldOfView(), unlabelled
        )
        yield replace(scan, sensor="pandar64", profile=PANDAR64)


def _turn_rad(points: Float32, box: Float64) -> float:
    """A quarter turn [rad] where the box then holds TURNED_RATIO times the points or more, else zero."""
    turned = box + np.array([0, 0, 0, 0, 0, 0, np.pi / 2])
    held, held_turned = (points_in_box(points, candidate).sum() for candidate in (box, turned))
    return np.pi / 2 if held_turned > TURNED_RATIO * held else 0.0


def _pandaset_class(name: str, height_m: float) -> int | None:
    """Class of a cuboid; None between the classes."""
    if name in TWO_WHEELERS:
        return ObjectClass.CYCLIST if height_m > RIDDEN_M else ObjectClass.BACKGROUND
    if not name.startswith("TYPE_"):
        name = name.replace("_", " ")  # the tables differ
    object_class, role = PANDASET_TYPES.get(name, (ObjectClass.BACKGROUND, Role.COUNTED))
    return None if role != Role.COUNTED or name in PANDASET_UNKNOWN else object_class
