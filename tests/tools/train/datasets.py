"""Data sets and scans for the tests of the training tools."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from modt.classes import CLASSES, ObjectClass
from modt.classification.crops import Crops
from modt.config import SensorConfig
from modt.geometry import FieldOfView
from modt.types import N_REFLECTANCE, NONE, Bool, Float32, Int
from modt_training.dataset import Dataset, LabelledObjects, Sensors
from modt_training.scan import Scan


def data_of(crops: Crops, label: Int, **columns: Any) -> Dataset:
    """Crops of one real drive, whole and without reflectance, except for the columns given."""
    n = len(crops)
    false = np.zeros(n, np.bool_)
    zero = np.zeros(n, np.int64)
    table: dict[str, Any] = {
        "sensors": Sensors.of(SensorConfig(), np.ones((n, 7)), np.full(n, -1.73)),
        "majority": label,
    }
    table |= {"partial": false, "unknown": false, "tall": false, "variant": zero, "drive": zero, "sensor": zero}
    table |= {"reflectance": np.full((n, N_REFLECTANCE), np.nan), "truth": truth_of(zero[:0], zero[:0])}
    table |= {"sensor_names": ("hdl-64e",), "provenance": [], "sha256": []}
    return Dataset(crops, label=label, **(table | columns))


def truth_of(label: Int, drive: Int, **columns: Any) -> LabelledObjects:
    """Objects of 30 points of one sensor, without crops, except for the columns given."""
    n = len(label)
    table: dict[str, Any] = {"points": np.full(n, 30), "sensor": np.zeros(n, np.int64), "row": np.full(n, NONE)}
    return LabelledObjects(label=label, drive=drive, **(table | columns))


def scan_of(points: Float32, objects: list[Int], kinds: list[ObjectClass], unlabelled: Bool) -> Scan:
    """A scan over the full circle whose objects have no boxes."""
    boxes = np.full((len(objects), 7), np.nan)
    return Scan("scan", "drive", points, tuple(objects), tuple(kinds), boxes, FieldOfView(), unlabelled)


def write_folder(folder: Path, scans: Iterable[Scan]) -> None:
    """Write scans as DRIVE_NUMBER in KITTI's object layout, without calibration."""
    for name in ("velodyne", "label_2"):
        (folder / name).mkdir(parents=True)
    for number, scan in enumerate(scans):
        stem = f"{scan.drive}_{number:06d}"
        scan.points.tofile(folder / "velodyne" / f"{stem}.bin")
        lines = [
            f"{CLASSES[kind].kitti[0]} 0 0 0 0 0 1 1 {h} {w} {length} {-y} {-z} {x} {-yaw - np.pi / 2}\n"
            for kind, (x, y, z, length, w, h, yaw) in zip(scan.kinds, scan.boxes.tolist(), strict=True)
            if kind
        ]
        (folder / "label_2" / f"{stem}.txt").write_text("".join(lines), encoding="utf-8")
