"""KITTI's folder layouts: raw drives, tracking and odometry sequences, bare folders of scans."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera
from modt.sources import calibration, oxts
from modt.sources.poses import read_poses, sensor_poses
from modt.sources.scan_stream import ScanReference, ScanStream
from modt.sources.stream import StreamInfo
from modt.types import Float64

PERIOD_S = 0.1
LONGEST_TURN = 2
"""A sweep that lasts more periods than this does not."""
AT_ONCE = "sweeps are taken for seen at once"
NO_POSES = "no odometry, the proposals must tell how the sensor moves"

Poses = dict[int, Float64]
"""T_world_sensor by frame."""


@dataclass(frozen=True, slots=True)
class Notes:
    """What is missing: of the stream, and of its poses, which may come from elsewhere."""

    of_stream: list[str] = field(default_factory=list)
    of_poses: list[str] = field(default_factory=list)


def raw_drive(drive: Path) -> ScanStream:
    """A raw drive, .../2011_09_26_drive_0005_sync, its day's calibration beside it.

    Raises:
        MisuseError: it holds no scans, or a file that is there is broken.
    """
    notes = Notes()
    camera = _camera(calibration.camera_of_raw, drive.parent / "calib_cam_to_cam.txt", notes)
    poses = _poses_of_raw(drive, notes)
    stamps = _raw_stamps(drive / "velodyne_points" / "timestamps.txt", notes)
    turns = _raw_turns(drive / "velodyne_points", notes)
    data = drive / "velodyne_points" / "data"
    return _stream(drive.name, "KITTI raw drive", data, camera, poses, stamps, notes, turns=turns)


def tracking_sequence(scans: Path) -> ScanStream:
    """A sequence of the tracking layout, .../training/velodyne/0005, with calib/, oxts/ beside velodyne/.

    Its sweeps are those of raw drives, without their times: a turn of the head is taken to last the period.

    Raises:
        MisuseError: it holds no scans, or a file that is there is broken.
    """
    root, number = scans.parent.parent, scans.name
    notes = Notes()
    calib = root / "calib" / f"{number}.txt"
    camera = _camera(calibration.camera_of_sequence, calib, notes)
    records = root / "oxts" / f"{number}.txt"
    poses: Poses = {}
    if not records.is_file():
        notes.of_poses.append(f"{records} is missing: {NO_POSES}")
    elif not calib.is_file():
        notes.of_poses.append(f"{calib} is missing, and its Tr_imu_velo: {NO_POSES}")
    else:
        T_imu_sensor = calibration.T_imu_sensor_of_sequence(calib)
        poses = dict(enumerate(oxts.poses(oxts.read_sequence(records)) @ T_imu_sensor))
    name = f"tracking {number}"
    return _stream(name, "KITTI tracking", scans, camera, poses, {}, notes, sequence=int(number), turn_s=PERIOD_S)


def odometry_sequence(sequence: Path) -> ScanStream:
    """A sequence of the odometry layout, .../sequences/00, with calib.txt, times.txt and poses where there are.

    Its sweeps are published as seen at once.

    Raises:
        MisuseError: it holds no scans, or a file that is there is broken.
    """
    notes = Notes()
    calib = sequence / "calib.txt"
    camera = _camera(calibration.camera_of_sequence, calib, notes)
    places = (sequence / "poses.txt", sequence.parent.parent / "poses" / f"{sequence.name}.txt")
    found = next((p for p in places if p.is_file()), None)
    poses: Poses = {}
    if found is None or camera is None:
        notes.of_poses.append(f"{places[0] if found is None else calib} is missing: {NO_POSES}")
    else:
        poses = dict(enumerate(sensor_poses(read_poses(found), camera.T_camera_sensor)))
    times = sequence / "times.txt"
    stamps: dict[int, float] = {}
    if times.is_file():
        stamps = dict(enumerate(_numbers(times, columns=1)[:, 0].tolist()))
    else:
        notes.of_stream.append(f"{times} is missing: frames {PERIOD_S} s apart")
    return _stream(f"odometry {sequence.name}", "KITTI odometry", sequence / "velodyne", camera, poses, stamps, notes)


def scan_folder(folder: Path) -> ScanStream:
    """A bare folder of .bin scans, in the order of their names.

    Raises:
        MisuseError: it holds none.
    """
    notes = Notes([f"a bare folder: no calibration, frames {PERIOD_S} s apart"], [f"a bare folder: {NO_POSES}"])
    return _stream(folder.name, "folder of scans", folder, None, {}, {}, notes)


def _stream(
    name: str,
    layout: str,
    data: Path,
    camera: Camera | None,
    poses: Poses,
    stamps: dict[int, float],
    notes: Notes,
    *,
    sequence: int = 0,
    turns: Mapping[int, float] = MappingProxyType({}),
    turn_s: float = 0.0,
) -> ScanStream:
    files = sorted(data.glob("*.bin"))
    if not files:
        raise MisuseError(data, "no .bin scans", "give a folder that holds them")
    numbered = all(f.stem.isdigit() for f in files)
    indices = [int(f.stem) for f in files] if numbered else list(range(len(files)))
    gaps = sorted(set(range(indices[0], indices[-1] + 1)) - set(indices))
    if gaps:
        notes.of_stream.append(f"{len(gaps)} frames are missing (the first is {gaps[0]})")
    if poses:
        lost = [i for i in indices if i not in poses]
        if lost:
            held = f"{len(lost)} frames without a pose keep the pose before them (the first is {lost[0]})"
            notes.of_poses.append(held)
        poses = _held(poses, indices)
    scans = [
        ScanReference(i, f, stamps.get(i, i * PERIOD_S), poses.get(i), turns.get(i, turn_s))
        for i, f in zip(indices, files, strict=True)
    ]
    if any(b.stamp_s < a.stamp_s for a, b in pairwise(scans)):
        notes.of_stream.append(f"time stamps run backwards: frames {PERIOD_S} s apart instead")
        scans = [replace(s, stamp_s=s.index * PERIOD_S) for s in scans]
    info = StreamInfo(
        name=name,
        layout=layout,
        sequence=sequence,
        n_frames=len(scans),
        period_s=PERIOD_S,
        camera=camera,
        has_poses=bool(poses),
        notes=tuple(notes.of_stream),
        pose_notes=tuple(notes.of_poses),
    )
    return ScanStream(info, scans)


def _held(poses: Poses, indices: list[int]) -> Poses:
    """A pose for every frame: its own, or the last one before it, or else the first there is."""
    known = np.array(sorted(poses))
    at = np.maximum(np.searchsorted(known, indices, side="right") - 1, 0)
    return {i: poses[int(known[k])] for i, k in zip(indices, at, strict=True)}


def _poses_of_raw(drive: Path, notes: Notes) -> Poses:
    records = sorted((drive / "oxts" / "data").glob("*.txt"))
    calib = drive.parent / "calib_imu_to_velo.txt"
    if not records or not calib.is_file():
        notes.of_poses.append(f"{calib if records else drive / 'oxts' / 'data'} is missing: {NO_POSES}")
        return {}
    T_imu_sensor = calibration.T_imu_sensor_of_raw(drive.parent)
    T_world_imu = oxts.poses(np.stack([oxts.read_record(r)[: len(oxts.FIELDS)] for r in records]))
    return dict(zip((int(r.stem) for r in records), T_world_imu @ T_imu_sensor, strict=True))


def _raw_stamps(path: Path, notes: Notes) -> dict[int, float]:
    """Seconds since the first stamp, by frame."""
    if not path.is_file():
        notes.of_stream.append(f"{path} is missing: frames {PERIOD_S} s apart")
        return {}
    try:
        times = _times_ns(path)
    except ValueError:
        notes.of_stream.append(f"{path} is no list of time stamps: frames {PERIOD_S} s apart")
        return {}
    return {i: (t - times[0]) / 1e9 for i, t in enumerate(times)}


def _raw_turns(folder: Path, notes: Notes) -> dict[int, float]:
    """Time that the head took to turn [s], by frame; nothing where that is not known, or cannot be."""
    texts = []
    for end in ("start", "end"):
        path = folder / f"timestamps_{end}.txt"
        if not path.is_file():
            notes.of_stream.append(f"{path} is missing: {AT_ONCE}")
            return {}
        try:
            texts.append(_times_ns(path))
        except ValueError:
            notes.of_stream.append(f"{path} is no list of time stamps: {AT_ONCE}")
            return {}
    starts, ends = texts
    if len(starts) != len(ends):
        notes.of_stream.append(f"{folder} holds {len(starts)} starts and {len(ends)} ends of sweeps: {AT_ONCE}")
        return {}
    turns = [(end - start) / 1e9 for start, end in zip(starts, ends, strict=True)]
    period_s = float(np.median(np.diff(starts))) / 1e9 if len(starts) > 1 else PERIOD_S
    odd = [i for i, turn_s in enumerate(turns) if not 0.0 <= turn_s <= LONGEST_TURN * period_s]
    if odd:
        impossible = f"less than nothing or more than {LONGEST_TURN} periods"
        notes.of_stream.append(f"{len(odd)} sweeps of {folder} last {impossible} (the first is {odd[0]}): {AT_ONCE}")
        return {}
    return dict(enumerate(turns))


def _times_ns(path: Path) -> list[int]:
    """Times of a list of KITTI's, a line each [ns].

    Raises:
        ValueError: it is none.
    """
    parts = [line.partition(".") for line in path.read_text().splitlines() if line]
    return [
        int(datetime.fromisoformat(second).replace(tzinfo=UTC).timestamp()) * 10**9 + int(fraction[:9].ljust(9, "0"))
        for second, _, fraction in parts
    ]


def _camera(read: Callable[[Path], Camera], calib: Path, notes: Notes) -> Camera | None:
    if not calib.is_file():
        notes.of_stream.append(f"{calib} is missing: no camera, hence no --fov camera")
        return None
    return read(calib)


def _numbers(path: Path, columns: int) -> Float64:
    try:
        table = np.loadtxt(path, dtype=np.float64, ndmin=2)
    except (OSError, ValueError) as error:
        raise MisuseError(path, f"no table of numbers ({error})", "restore it, or remove it") from None
    if table.shape[1] != columns:
        raise MisuseError(path, f"{table.shape[1]} columns, not {columns}", "restore it, or remove it")
    return table
