"""Labelled scans: where real objects stand, whatever the format that says so."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt.geometry import Camera, FieldOfView, inverse, se3, transform
from modt.types import Bool, Float32, Float64, ObjectClass

CLASS_OF = {
    "Car": ObjectClass.CAR,
    "Van": ObjectClass.CAR,
    "Pedestrian": ObjectClass.PEDESTRIAN,
    "Person_sitting": ObjectClass.PEDESTRIAN,
    "Cyclist": ObjectClass.CYCLIST,
}
"""Whatever else is labelled counts as background, as in the paper."""
IMAGE_PX = (1242.0, 375.0)
PAD_M, FOOT_M = 0.15, 0.25
TEST_DRIVE = "2011_09_26_drive_0005_sync"


@dataclass(frozen=True)
class Scan:
    """A scan and its labels.

    Attributes:
        name: of the scan.
        drive: recording it is part of; scans of one drive are never split between training and validation.
        points: (N, 4) sensor frame.
        boxes: (B, 7) x, y, z of the middle of the foot, l, w, h, yaw, sensor frame.
        kinds: label of each box as the data set spells it.
        fov: where labels are complete.
        unlabelled: (N,) points in regions that the annotators left out.
    """

    name: str
    drive: str
    points: Float32
    boxes: Float64
    kinds: tuple[str, ...]
    fov: FieldOfView
    unlabelled: Bool


def inside(points: Float32, box: Float64) -> Bool:
    """(N,) points of the object in a box: a little beyond its sides, and clear of the ground."""
    c, s = np.cos(box[6]), np.sin(box[6])
    x, y, z = points[:, 0] - box[0], points[:, 1] - box[1], points[:, 2] - box[2]
    within: Bool = (
        (np.abs(c * x + s * y) < box[3] / 2 + PAD_M)
        & (np.abs(c * y - s * x) < box[4] / 2 + PAD_M)
        & (z > FOOT_M)
        & (z < box[5] + PAD_M)
    )
    return within


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
    camera = object_camera(calib)
    points = np.fromfile(path, np.float32).reshape(-1, 4)
    boxes, kinds, regions = [], [], []
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
    return Scan(
        path.stem,
        drive,
        points,
        np.array(boxes).reshape(-1, 7),
        tuple(kinds),
        fov,
        _in_regions(points, camera, np.array(regions).reshape(-1, 4)),
    )


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


def raw_scans(drive: Path) -> Iterator[Scan]:
    """Scans of a KITTI raw drive with tracklets."""
    assert drive.name != TEST_DRIVE, drive
    camera = _raw_camera(drive.parent)
    tracklets = _tracklets(drive / "tracklet_labels.xml")
    for path in sorted((drive / "velodyne_points" / "data").glob("*.bin")):
        frame = int(path.stem)
        here = [(kind, hwl, poses[frame - f0]) for kind, hwl, f0, poses in tracklets if f0 <= frame < f0 + len(poses)]
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        boxes = [[*pose[:3], hwl[2], hwl[1], hwl[0], pose[3]] for _, hwl, pose in here]
        yield Scan(
            f"{drive.name}/{path.stem}",
            drive.name,
            points,
            np.array(boxes).reshape(-1, 7),
            tuple(kind for kind, _, _ in here),
            FieldOfView.of_camera(camera),
            np.zeros(len(points), np.bool_),
        )


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
