"""Labels on disk: KITTI's layouts, tables of cuboids, nuScenes and Argoverse 2."""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera, se3, transform_boxes
from modt.sources import argoverse, nuscenes
from modt.sources.file_names import files_in
from modt.sources.kitti_calibration import camera_of_sequence
from modt.sources.pose_file import read_poses
from modt.sources.recognise import open_scans
from modt.sources.scan_file import ScanStream
from modt.types import NONE
from modt_evaluation.dataset_labels import ANNOTATIONS, argoverse_labels, nuscenes_labels
from modt_evaluation.kitti_labels import DONT_CARE, MAX_ID, Label, read_labels, read_tracklets, upright
from modt_evaluation.label_names import ARGOVERSE_TYPES, CUBOID_TYPES, KITTI_NAMES, NUSCENES_TYPES
from modt_evaluation.rules import CUBOID_RULES, KITTI_ALL_ROUND_RULES, KITTI_RULES
from modt_evaluation.truth import (
    KITTI_TYPES,
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
GIVE = (
    "give a raw drive with tracklets, label_02/NNNN.txt, object/training, a folder with truth.csv and poses.txt, a "
    "scene of nuScenes or a log of Argoverse 2"
)


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
    truth = _dataset(path) or _cuboid_folder(path, run_path)
    if truth is not None:
        return truth
    cause = "holds no labels that are recognised" if path.exists() else "no such file or directory"
    raise MisuseError(path, cause, GIVE)


def labels_beside(stream: Path) -> Path | None:
    """Path of the labels of a recording, if they are where its layout puts them."""
    if (stream / TRACKLETS).is_file():
        return stream
    sequence = stream.parent.parent / "label_02" / f"{stream.name}.txt"
    if sequence.is_file():
        return sequence
    if (stream.parent / CUBOIDS).is_file():
        return stream.parent
    named = (stream / CUBOIDS).is_file() or (stream / ANNOTATIONS).is_file() or nuscenes.tables_of(stream) is not None
    return stream if named else None


def _dataset(path: Path) -> Truth | None:
    """Truth of a scene of nuScenes or a log of Argoverse 2; None where there is none."""
    if (tables := nuscenes.tables_of(path.resolve())) is not None:
        scans = nuscenes.open_scene(*tables)
        scene = nuscenes.read_scene(*tables)
        labels = nuscenes_labels(scene)
        T_box_sensor = dict(enumerate(scene.poses))
        types = NUSCENES_TYPES
    elif (path / ANNOTATIONS).is_file():
        scans = argoverse.open_log(path)
        labels = argoverse_labels(path, {int(scan.path.stem): scan.index for scan in scans.scans})
        T_vehicle_sensor = argoverse.sensor_in_vehicle(path)
        T_box_sensor = dict.fromkeys(labels, np.eye(4) if T_vehicle_sensor is None else T_vehicle_sensor)
        types = ARGOVERSE_TYPES
    else:
        return None
    frames = {f: _frame(types, path, of_frame, T_box_sensor=T_box_sensor[f]) for f, of_frame in labels.items()}
    return Truth(frames, scans, CUBOID_RULES, key_frames=len(frames) < len(scans.scans))


def _cuboid_folder(path: Path, run_path: Path | None) -> Truth | None:
    """Truth of a folder with tables of cuboids; None where there is none."""
    scans = _scans(path / SCANS, run_path)
    if (path / CUBOIDS).is_file():
        return Truth(_cuboids(path, scans), scans, CUBOID_RULES)
    if scans and (path / SCANS).is_dir():
        return Truth(_tables_by_scan(path, scans), scans, CUBOID_RULES)
    return None


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
    place = scans.info.name if scans else "labels"
    end = max([*by_frame, *(scan.index for scan in recorded)], default=NONE) + 1
    none = np.zeros((0, 7))
    frames = {}
    for f in range(end):
        frame = _frame(types, place, by_frame[f], camera, parked=parked.get(f, none))
        frames[f] = _upright(frame, by_frame[f])
    return Truth(frames, scans, KITTI_ALL_ROUND_RULES if any(map(_behind, labels)) else KITTI_RULES)


def _upright(frame: FrameTruth, labels: list[Label]) -> FrameTruth:
    """A frame whose boxes stand upright, by the mean `up` of its labels; unchanged if none has one."""
    ups = [label.up for label in labels if label.up is not None]
    if not ups:
        return frame
    up = np.mean(ups, axis=0)
    T_level_sensor = se3(upright(up / np.linalg.norm(up)), np.zeros(3))
    box = transform_boxes(T_level_sensor, frame.box)
    parked = transform_boxes(T_level_sensor, frame.parked)
    return replace(frame, box=box, parked=parked, T_box_sensor=T_level_sensor)


def _behind(label: Label) -> bool:
    """Whether the whole box is behind the sensor, where KITTI labels nothing."""
    x, _, _, length, width, *_ = label.box.tolist()
    return bool(label.type_ != DONT_CARE and x + np.hypot(length, width) / 2 < 0)


def _object_frame(path: Path, types: Types) -> FrameTruth:
    camera = camera_of_sequence(path.parents[1] / "calib" / path.name)
    return _frame(types, path, read_labels(path, camera, tracking=False), camera)


def _cuboids(folder: Path, scans: ScanStream | None) -> Mapping[int, FrameTruth]:
    """Cuboids in the world, and the sensor's poses in it, a line a frame.

    Where the names of the scans are numbers that do not begin at 0, the first line is that of the first scan. Frames
    of the table are these numbers, unless all are below the number of poses.
    """
    poses = read_poses(folder / POSES)
    by_frame = _by_frame(_rows(folder / CUBOIDS))
    numbers = [scan.index for scan in scans.scans] if scans else []
    if len(numbers) != len(poses):
        numbers = list(range(len(poses)))
    if max(by_frame, default=0) < len(poses):
        by_frame = defaultdict(list, {number: by_frame[i] for i, number in enumerate(numbers)})
    elif strangers := by_frame.keys() - set(numbers):
        cause = f"{len(poses)} poses, none for frame {max(strangers)}"
        raise MisuseError(folder / POSES, cause, "give one a frame, which is the number of a scan or counts from 0")
    place = folder / CUBOIDS
    return {f: _frame(CUBOID_TYPES, place, by_frame[f], T_box_sensor=T) for f, T in zip(numbers, poses, strict=True)}


def _tables_by_scan(folder: Path, scans: ScanStream) -> Mapping[int, FrameTruth]:
    """Cuboids of the scans that have a table of their name."""
    tables = {scan.index: folder / f"{scan.path.stem}.csv" for scan in scans.scans}
    return {frame: _frame(CUBOID_TYPES, table, _rows(table)) for frame, table in tables.items() if table.is_file()}


def _by_frame(labels: Iterable[Label]) -> dict[int, list[Label]]:
    groups: dict[int, list[Label]] = defaultdict(list)
    for label in labels:
        groups[label.frame].append(label)
    return groups


def _frame(
    types: Types, place: object, labels: Iterable[Label], camera: Camera | None = None, **more: Any
) -> FrameTruth:
    """Truth of a frame; `place` is where the labels are from.

    Raises:
        MisuseError: the name of a label is not known.
    """
    labels = list(labels)
    for label in labels:
        if label.type_ not in types and label.type_ not in KITTI_NAMES:
            known = sorted({*types, *KITTI_NAMES} - {DONT_CARE})
            near = get_close_matches(label.type_, known, 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            remedy = f"{hint}write one of these names: {', '.join(known)}"
            raise MisuseError(place, f"label {label.type_!r} is unknown", remedy)
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
