"""Labels on disk: KITTI's layouts and tables of cuboids."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.evaluation.rules import CUBOID_RULES, KITTI_RULES
from modt.evaluation.truth import KITTI_TYPES, PANDASET_TYPES, PAPER_TYPES, FrameTruth, Regions, Truth, parked_outside
from modt.geometry import Camera
from modt.sources import calibration, kitti_labels
from modt.sources.kitti_labels import DONT_CARE, Label, Tracklet
from modt.sources.poses import read_poses
from modt.sources.recognise import open_stream
from modt.sources.scan_stream import ScanStream
from modt.types import NONE, Float64

TRACKLETS, TRUTH_CSV, POSES = "tracklet_labels.xml", "truth.csv", "poses.txt"
CLASSES = ("all", "paper")
"""Van and Person_sitting as Car and Pedestrian, or ignored as in Table III of the paper."""
BOX_COLUMNS = (("x",), ("y",), ("z",), ("l", "length"), ("w", "width"), ("h", "height"), ("yaw",))
GIVE = "give a raw drive with tracklets, label_02/NNNN.txt, object/training, or a folder with truth.csv and poses.txt"


def open_truth(path: Path, run_path: Path | None = None, classes: str = "all") -> Truth:
    """The labels that lie at a path.

    Args:
        path: KITTI raw drive, tracking label file or folder, object folder, folder with tables of cuboids.
        run_path: the stream of the run that is judged, for scans and poses where none lie beside the labels.
        classes: of CLASSES, for KITTI's labels.

    Raises:
        MisuseError: nothing there is recognised, or a file is broken.
    """
    if (path / TRACKLETS).is_file():
        return _raw_drive(path, _scans(path, run_path), classes)
    if (path / TRUTH_CSV).is_file():
        return _cuboids(path, _scans(path / "scans", run_path))
    if path.suffix == ".txt" and path.is_file():
        return _tracking(path, _scans(path.parent.parent / "velodyne" / path.stem, run_path), classes)
    if (path / "label_02").is_dir():
        labels = path / "label_02" / f"{run_path.name if run_path else ''}.txt"
        if not labels.is_file():
            raise MisuseError(path, "holds several sequences", "give the label file, label_02/NNNN.txt")
        return open_truth(labels, run_path, classes)
    if (path / "label_2").is_dir():
        return _object_frames(path, _scans(path / "velodyne", run_path), classes)
    if (path / "scans").is_dir() and next(path.glob("*.csv"), None):
        return _cuboid_scans(path, _scans(path / "scans", run_path))
    cause = "holds no labels that are recognised" if path.exists() else "no such file or directory"
    raise MisuseError(path, cause, GIVE)


def _scans(beside: Path, run_path: Path | None) -> ScanStream | None:
    """The recording beside the labels, or else the one that the run names."""
    for path in (beside, run_path):
        if path is not None and path.is_dir():
            try:
                return open_stream(path)
            except MisuseError:
                continue
    return None


def _poses(scans: ScanStream | None) -> dict[int, Float64]:
    """T_world_sensor by frame."""
    return {s.index: s.T_world_sensor for s in (scans.scans if scans else ()) if s.T_world_sensor is not None}


def _followed(
    tracklets: list[Tracklet],
    scans: ScanStream | None,
    classes: str,
    ids: list[int],
    regions: Mapping[int, Regions],
) -> Truth:
    """Truth of objects that are followed."""
    types = PAPER_TYPES if classes == "paper" else KITTI_TYPES
    parked = parked_outside(tracklets, types, _poses(scans))
    rows: dict[int, list[tuple[int, str, Float64]]] = defaultdict(list)
    for id_, item in zip(ids, tracklets, strict=True):
        for k, box in enumerate(item.box):
            rows[item.first + k].append((id_, item.type_, box))
    end = max([*rows, *(s.index for s in (scans.scans if scans else ())), *regions], default=NONE) + 1
    none = np.zeros((0, 7))
    frames = {
        f: FrameTruth.of(
            types,
            [id_ for id_, _, _ in rows[f]],
            [type_ for _, type_, _ in rows[f]],
            [box for _, _, box in rows[f]],
            parked=parked.get(f, none),
            regions=regions.get(f),
        )
        for f in range(end)
    }
    return Truth(frames, scans, KITTI_RULES)


def _raw_drive(drive: Path, scans: ScanStream | None, classes: str) -> Truth:
    tracklets = kitti_labels.read_tracklets(drive / TRACKLETS)
    return _followed(tracklets, scans, classes, list(range(len(tracklets))), {})


def _tracking(path: Path, scans: ScanStream | None, classes: str) -> Truth:
    camera = calibration.camera_of_sequence(path.parent.parent / "calib" / path.name)
    labels = kitti_labels.read_labels(path, tracking=True)
    pieces = [piece for labels_of in _by_object(labels) for piece in _tracklets(labels_of, camera)]
    regions = {f: _regions(group, camera) for f, group in _by_frame(labels).items()}
    ids = [id_ for id_, _ in pieces]
    return _followed([item for _, item in pieces], scans, classes, ids, {f: r for f, r in regions.items() if r})


def _by_object(labels: list[Label]) -> list[list[Label]]:
    groups: dict[tuple[int, str], list[Label]] = defaultdict(list)
    for label in labels:
        if label.type_ != DONT_CARE:
            groups[label.id, label.type_].append(label)
    return list(groups.values())


def _by_frame(labels: list[Label]) -> dict[int, list[Label]]:
    groups: dict[int, list[Label]] = defaultdict(list)
    for label in labels:
        groups[label.frame].append(label)
    return groups


def _tracklets(labels: list[Label], camera: Camera) -> Iterator[tuple[int, Tracklet]]:
    """An object's labels, cut where a frame is left out."""
    frames, boxes = np.array([label.frame for label in labels]), kitti_labels.boxes(labels, camera)
    for rows in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames) != 1) + 1):
        yield labels[0].id, Tracklet(labels[0].type_, int(frames[rows[0]]), boxes[rows])


def _regions(labels: list[Label], camera: Camera) -> Regions | None:
    edges = [label.image_box for label in labels if label.type_ == DONT_CARE]
    return Regions(np.array(edges), camera) if edges else None


def _object_frames(folder: Path, scans: ScanStream | None, classes: str) -> Truth:
    frames = {}
    for path in sorted((folder / "label_2").glob("*.txt")):
        camera = calibration.camera_of_sequence(folder / "calib" / path.name)
        labels = kitti_labels.read_labels(path, tracking=False)
        own = [label for label in labels if label.type_ != DONT_CARE]
        frames[int(path.stem)] = FrameTruth.of(
            PAPER_TYPES if classes == "paper" else KITTI_TYPES,
            [NONE] * len(own),
            [label.type_ for label in own],
            kitti_labels.boxes(own, camera),
            regions=_regions(labels, camera),
        )
    return Truth(frames, scans, KITTI_RULES)


def _cuboids(folder: Path, scans: ScanStream | None) -> Truth:
    """Cuboids in the world, and the sensor's poses in it, a line a frame."""
    poses = read_poses(folder / POSES)
    rows: dict[int, list[tuple[int, str, list[float]]]] = defaultdict(list)
    path = folder / TRUTH_CSV
    for number, row in _rows(path):
        try:
            frame, track = int(row["frame"]), int(row["track"])
        except (KeyError, ValueError):
            raise MisuseError(f"{path}:{number}", "no frame and track", "write their numbers") from None
        rows[frame].append((track, row.get("label", ""), _box(row, f"{path}:{number}")))
    if rows and max(rows) >= len(poses):
        raise MisuseError(folder / POSES, f"{len(poses)} poses, none for frame {max(rows)}", "give one a frame")
    frames = {
        f: FrameTruth.of(
            PANDASET_TYPES,
            [id_ for id_, _, _ in rows[f]],
            [type_ for _, type_, _ in rows[f]],
            np.array([box for _, _, box in rows[f]]),
            T_box_sensor=T,
        )
        for f, T in enumerate(poses)
    }
    return Truth(frames, scans, CUBOID_RULES)


def _cuboid_scans(folder: Path, scans: ScanStream | None) -> Truth:
    """A table beside each scan, of its name, in the scan's own coordinates."""
    index = {scan.path.stem: scan.index for scan in (scans.scans if scans else ())}
    frames = {}
    for path in sorted(folder.glob("*.csv")):
        rows = [(row.get("class", ""), _box(row, f"{path}:{number}")) for number, row in _rows(path)]
        if path.stem in index:
            frames[index[path.stem]] = FrameTruth.of(
                PANDASET_TYPES, [NONE] * len(rows), [name for name, _ in rows], np.array([box for _, box in rows])
            )
    return Truth(frames, scans, CUBOID_RULES)


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    try:
        with path.open(encoding="utf-8", newline="") as lines:
            yield from enumerate(csv.DictReader(lines), 2)
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "restore the table") from None


def _box(row: dict[str, str], place: str) -> list[float]:
    try:
        return [float(next(row[name] for name in names if name in row)) for names in BOX_COLUMNS]
    except (StopIteration, ValueError, TypeError):
        raise MisuseError(place, "no cuboid", "write x, y, z, l, w, h, yaw as numbers") from None
