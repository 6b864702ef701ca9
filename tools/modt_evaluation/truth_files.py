"""Labels on disk: KITTI's layouts and tables of cuboids."""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera
from modt.sources.file_names import files_in
from modt.sources.kitti_calibration import camera_of_sequence
from modt.sources.pose_file import read_poses
from modt.sources.recognise import open_scans
from modt.sources.scan_file import ScanStream
from modt.types import NONE
from modt_evaluation.kitti_labels import DONT_CARE, MAX_ID, Label, read_labels, read_tracklets
from modt_evaluation.rules import CUBOID_RULES, KITTI_ALL_ROUND_RULES, KITTI_RULES
from modt_evaluation.truth import (
    KITTI_TYPES,
    PANDASET_TYPES,
    PAPER_TYPES,
    FrameTruth,
    Regions,
    Truth,
    Types,
    parked_outside,
)

TRACKLETS = "tracklet_labels.xml"
CUBOIDS = "truth.csv"
POSES = "poses.txt"
SCANS = "scans"
BOX_COLUMNS = (("x",), ("y",), ("z",), ("l", "length"), ("w", "width"), ("h", "height"), ("yaw",))
GIVE = "give a raw drive with tracklets, label_02/NNNN.txt, object/training, or a folder with truth.csv and poses.txt"


def open_truth(path: Path, run_path: Path | None = None, *, paper: bool = False) -> Truth:
    """The labels at a path.

    Args:
        path: KITTI raw drive, tracking label file or folder, object folder, folder with tables of cuboids.
        run_path: the stream of the run that is judged, for scans and poses where none lie beside the labels.
        paper: ignore KITTI's vans and sitting people, as Table III does.

    Raises:
        MisuseError: nothing there is recognised, or a file is broken.
    """
    types = PAPER_TYPES if paper else KITTI_TYPES
    if (path / TRACKLETS).is_file():
        return _followed(read_tracklets(path / TRACKLETS), types, _scans(path, run_path))
    if path.suffix == ".txt" and path.is_file():
        root = path.parents[1]
        camera = camera_of_sequence(root / "calib" / path.name)
        labels = read_labels(path, camera, tracking=True)
        return _followed(labels, types, _scans(root / "velodyne" / path.stem, run_path), camera)
    if (path / "label_02").is_dir():
        sequence = path / "label_02" / f"{run_path.name if run_path else ''}.txt"
        if not sequence.is_file():
            raise MisuseError(path, "holds several sequences", "give the label file, label_02/NNNN.txt")
        return open_truth(sequence, run_path, paper=paper)
    if (path / "label_2").is_dir():
        files = [file for file in files_in(path / "label_2", ".txt") if re.fullmatch("[0-9]+", file.stem)]
        frames = {int(file.stem): _object_frame(file, types) for file in files}
        return Truth(frames, _scans(path / "velodyne", run_path), KITTI_RULES)
    scans = _scans(path / SCANS, run_path)
    if (path / CUBOIDS).is_file():
        return Truth(_cuboids(path), scans, CUBOID_RULES)
    if scans and (path / SCANS).is_dir():
        return Truth(_tables_by_scan(path, scans), scans, CUBOID_RULES)
    cause = "holds no labels that are recognised" if path.exists() else "no such file or directory"
    raise MisuseError(path, cause, GIVE)


def labels_beside(stream: Path) -> Path | None:
    """Path of the labels of a recording, if they are where its layout puts them."""
    if (stream / TRACKLETS).is_file():
        return stream
    sequence = stream.parent.parent / "label_02" / f"{stream.name}.txt"
    if sequence.is_file():
        return sequence
    return stream.parent if (stream.parent / CUBOIDS).is_file() else None


def _scans(beside: Path, run_path: Path | None) -> ScanStream | None:
    """The recording beside the labels, or else the one that the run names."""
    for path in (beside, run_path):
        if path is not None and path.is_dir():
            try:
                return open_scans(path)
            except MisuseError:
                continue
    return None


def _followed(labels: list[Label], types: Types, scans: ScanStream | None, camera: Camera | None = None) -> Truth:
    """Truth of a drive's objects; every frame up to the last labelled or recorded one is labelled."""
    recorded = scans.scans if scans else []
    poses = {scan.index: scan.T_world_sensor for scan in recorded if scan.T_world_sensor is not None}
    parked = parked_outside(labels, types, poses)
    by_frame = _by_frame(labels)
    end = max([*by_frame, *(scan.index for scan in recorded)], default=NONE) + 1
    none = np.zeros((0, 7))
    frames = {f: _frame(types, by_frame[f], camera, parked=parked.get(f, none)) for f in range(end)}
    return Truth(frames, scans, KITTI_ALL_ROUND_RULES if any(map(_behind, labels)) else KITTI_RULES)


def _behind(label: Label) -> bool:
    """Whether the whole box is behind the sensor, where KITTI labels nothing."""
    x, _, _, length, width, *_ = label.box.tolist()
    return bool(label.type_ != DONT_CARE and x + np.hypot(length, width) / 2 < 0)


def _object_frame(path: Path, types: Types) -> FrameTruth:
    camera = camera_of_sequence(path.parents[1] / "calib" / path.name)
    return _frame(types, read_labels(path, camera, tracking=False), camera)


def _cuboids(folder: Path) -> Mapping[int, FrameTruth]:
    """Cuboids in the world, and the sensor's poses in it, a line a frame."""
    poses = read_poses(folder / POSES)
    by_frame = _by_frame(_rows(folder / CUBOIDS))
    if max(by_frame, default=0) >= len(poses):
        raise MisuseError(folder / POSES, f"{len(poses)} poses, none for frame {max(by_frame)}", "give one a frame")
    return {f: _frame(PANDASET_TYPES, by_frame[f], T_box_sensor=T) for f, T in enumerate(poses)}


def _tables_by_scan(folder: Path, scans: ScanStream) -> Mapping[int, FrameTruth]:
    """Cuboids of the scans that have a table of their name."""
    tables = {scan.index: folder / f"{scan.path.stem}.csv" for scan in scans.scans}
    return {frame: _frame(PANDASET_TYPES, _rows(table)) for frame, table in tables.items() if table.is_file()}


def _by_frame(labels: Iterable[Label]) -> dict[int, list[Label]]:
    groups: dict[int, list[Label]] = defaultdict(list)
    for label in labels:
        groups[label.frame].append(label)
    return groups


def _frame(types: Types, labels: Iterable[Label], camera: Camera | None = None, **more: Any) -> FrameTruth:
    labels = list(labels)
    objects = [label for label in labels if label.type_ != DONT_CARE]
    edges = [label.image_box for label in labels if label.type_ == DONT_CARE]
    return FrameTruth.of(
        types,
        [label.id for label in objects],
        [label.type_ for label in objects],
        [label.box for label in objects],
        regions=Regions(np.array(edges), camera) if edges and camera else None,
        **more,
    )


def _rows(path: Path) -> Iterator[Label]:
    """The cuboids of a table. Without columns for frame and track, all are in frame 0 and have no identities."""
    try:
        with path.open(encoding="utf-8", newline="") as lines:
            for number, row in enumerate(csv.DictReader(lines), 2):
                try:
                    box = [float(next(row[name] for name in names if name in row)) for names in BOX_COLUMNS]
                    frame = int(row.get("frame", 0))
                    track = int(row.get("track", NONE))
                    if abs(track) > MAX_ID or not np.isfinite(box).all():
                        raise ValueError(box)
                except (StopIteration, ValueError, TypeError):
                    remedy = "write x, y, z, l, w, h, yaw, frame and track as numbers"
                    raise MisuseError(f"{path}:{number}", "no cuboid", remedy) from None
                yield Label(frame, track, row.get("label", row.get("class", "")), np.array(box))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MisuseError(path, f"cannot be read ({error})", "restore the table") from None
