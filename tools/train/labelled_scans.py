"""Labelled scans of KITTI (object, raw, odometry) and Argoverse 2 in one form."""

from __future__ import annotations

import csv
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from modt.classes import ObjectClass
from modt.geometry import Camera, FieldOfView, inverse, se3, transform
from modt.types import Bool, Float32, Float64, Int

CLASS_OF = {
    "Car": ObjectClass.CAR,
    "Van": ObjectClass.CAR,
    "Pedestrian": ObjectClass.PEDESTRIAN,
    "Person_sitting": ObjectClass.PEDESTRIAN,
    "Cyclist": ObjectClass.CYCLIST,
}
"""Other labelled types count as background, as in the paper."""
IMAGE_PX = (1242.0, 375.0)
PAD_M, FOOT_M = 0.15, 0.25
"""Margin around a box, and height above its bottom from which points belong to the object and not to the ground."""
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
    """(N,) points of the object in a box: at most PAD_M beyond its faces, at least FOOT_M above its bottom."""
    c, s = np.cos(box[6]), np.sin(box[6])
    x, y, z = points[:, 0] - box[0], points[:, 1] - box[1], points[:, 2] - box[2]
    within: Bool = (
        (np.abs(c * x + s * y) < box[3] / 2 + PAD_M)
        & (np.abs(c * y - s * x) < box[4] / 2 + PAD_M)
        & (z > FOOT_M)
        & (z < box[5] + PAD_M)
    )
    return within


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
    classes = tuple(CLASS_OF.get(kind, ObjectClass.BACKGROUND) for kind in kinds)
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
    camera = object_camera(calib)
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    boxes: list[list[float]] = []
    kinds: list[str] = []
    regions: list[Float64] = []
    for line in label.read_text(encoding="utf-8").splitlines():
        kind, *text = line.split()
        v = np.array([float(t) for t in text])
        if kind == "DontCare":
            regions.append(v[3:7])
            continue
        foot = transform(inverse(camera.T_camera_sensor), v[None, 10:13])[0]
        boxes.append([*foot, v[9], v[8], v[7], -v[13] - np.pi / 2])
        kinds.append(kind)
    fov = FieldOfView.of_camera(camera)
    unlabelled = _in_regions(points, camera, np.array(regions).reshape(-1, 4))
    return scan_from_boxes(path.stem, drive, points, boxes, kinds, fov, unlabelled)


def object_camera(calib: Path) -> Camera:
    """The left colour camera of a calibration file of the object benchmark."""
    lines = (line.split(":") for line in calib.read_text(encoding="utf-8").splitlines() if ":" in line)
    value = {key: np.array([float(t) for t in rest.split()]) for key, rest in lines}
    T_rect = se3(value["R0_rect"].reshape(3, 3), np.zeros(3))
    T_camera_sensor = T_rect @ np.vstack([value["Tr_velo_to_cam"].reshape(3, 4), [0, 0, 0, 1]])
    return Camera(value["P2"].reshape(3, 4) @ T_camera_sensor, T_camera_sensor, *IMAGE_PX)


def _in_regions(points: Float32, camera: Camera, regions: Float64) -> Bool:
    uvw = np.c_[points[:, :3], np.ones(len(points))] @ camera.P_image_sensor.T
    hit = np.zeros(len(points), np.bool_)
    ahead = np.flatnonzero(uvw[:, 2] > 1)
    u, v = (uvw[ahead, :2] / uvw[ahead, 2:]).T
    for left, top, right, bottom in regions:
        hit[ahead] |= (u > left) & (u < right) & (v > top) & (v < bottom)
    return hit


def raw_scans(drive: Path, *, confirm: bool = False) -> Iterator[Scan]:
    """Scans of a KITTI raw drive with tracklets; of the test drive only with `confirm`."""
    assert confirm or drive.name != TEST_DRIVE, drive
    camera = _raw_camera(drive.parent)
    tracklets = _tracklets(drive / "tracklet_labels.xml")
    for path in sorted((drive / "velodyne_points" / "data").glob("*.bin")):
        frame = int(path.stem)
        ids = [k for k, (_, _, first, poses) in enumerate(tracklets) if first <= frame < first + len(poses)]
        present = [(kind, hwl, poses[frame - first]) for kind, hwl, first, poses in (tracklets[k] for k in ids)]
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        boxes = [[*pose[:3], hwl[2], hwl[1], hwl[0], pose[3]] for _, hwl, pose in present]
        name, fov = f"{drive.name}/{path.stem}", FieldOfView.of_camera(camera)
        kinds = [kind for kind, _, _ in present]
        scan = scan_from_boxes(name, drive.name, points, boxes, kinds, fov, np.zeros(len(points), np.bool_))
        yield replace(scan, track_ids=tuple(ids))


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


def _raw_camera(date: Path) -> Camera:
    def read(name: str) -> dict[str, Float64]:
        lines = (line.split(":", 1) for line in (date / name).read_text(encoding="utf-8").splitlines())
        return {
            k: np.array([float(t) for t in v.split()]) for k, v in lines if k not in ("calib_time", "corner_dist")
        }

    cam, velo = read("calib_cam_to_cam.txt"), read("calib_velo_to_cam.txt")
    T_camera_sensor = se3(cam["R_rect_00"].reshape(3, 3), np.zeros(3)) @ se3(velo["R"].reshape(3, 3), velo["T"])
    return Camera(cam["P_rect_02"].reshape(3, 4) @ T_camera_sensor, T_camera_sensor, *IMAGE_PX)


def _tracklets(path: Path) -> list[tuple[str, Float64, int, Float64]]:
    found = []
    for item in ET.parse(path).getroot().iterfind("tracklets/item"):
        hwl = np.array([float(item.findtext(k, "nan")) for k in "hwl"])
        poses = [[float(p.findtext(k, "nan")) for k in ("tx", "ty", "tz", "rz")] for p in item.iterfind("poses/item")]
        first = int(item.findtext("first_frame", "0"))
        found.append((item.findtext("objectType", ""), hwl, first, np.array(poses)))
    return found
