"""KITTI's folder layouts: raw drives, tracking and odometry sequences, folders of scans.

Every reader raises a MisuseError for a folder without scans and for an invalid file.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from modt.errors import MisuseError
from modt.sources import kitti_calibration
from modt.sources.file_names import files_in, seconds_ns, time_ns, times_ns
from modt.sources.pose_file import read_poses, sensor_poses
from modt.sources.scan_file import NO_POSES, PERIOD_S, ScanReference, ScanStream
from modt.sources.stream import StreamInfo
from modt.types import Float64

MAX_NUMBER_DIGITS = 10
"""Greatest number of digits of a name that is the number of a frame."""
MAX_SWEEP_PERIODS = 2
"""Greatest duration of a sweep [periods]; a longer one is attributed to wrong time stamps."""
NO_SWEEP_TIMES = "sweeps are not deskewed"
NO_CAMERA = "no camera, no --fov camera"

T = TypeVar("T")
Poses = dict[int, Float64]
"""T_world_sensor by frame."""


def raw_drive(drive: Path) -> ScanStream:
    """A raw drive, .../2011_09_26_drive_0005_sync, with the calibration of the day in the parent folder."""
    notes: list[str] = []
    pose_notes: list[str] = []
    calib = drive.parent / "calib_cam_to_cam.txt"
    camera = _optional(kitti_calibration.camera_of_raw, calib, notes, NO_CAMERA)
    poses = _poses_of_raw(drive, pose_notes)
    folder = drive / "velodyne_points"
    scans = _scans(folder / "data")
    stamps = _stamps(folder / "timestamps.txt", scans, notes, time_ns)
    info = StreamInfo(drive.name, "KITTI raw drive", camera=camera)
    return _stream(info, scans, notes, pose_notes, poses, stamps, _raw_turns(folder, scans, notes))


def tracking_sequence(scans: Path) -> ScanStream:
    """A sequence of the tracking layout, .../training/velodyne/0005, with calib/ and oxts/ next to velodyne/.

    Its sweeps are those of raw drives without time stamps; each lasts one period.
    """
    root = scans.parent.parent
    number = scans.name
    notes: list[str] = []
    pose_notes: list[str] = []
    calib = root / "calib" / f"{number}.txt"
    camera = _optional(kitti_calibration.camera_of_sequence, calib, notes, NO_CAMERA)
    records = root / "oxts" / f"{number}.txt"
    poses: Poses = {}
    if absent := _absent(records):
        pose_notes.append(f"{records} {absent}: {NO_POSES}")
    else:
        T_imu_sensor = _optional(kitti_calibration.T_imu_sensor_of_sequence, calib, pose_notes, NO_POSES)
        if T_imu_sensor is not None:
            poses = dict(enumerate(kitti_calibration.oxts_poses(kitti_calibration.read_oxts(records)) @ T_imu_sensor))
    info = StreamInfo(f"tracking {number}", "KITTI tracking", int(number), camera=camera)
    files = _scans(scans)
    return _stream(info, files, notes, pose_notes, poses, {}, dict.fromkeys(files, PERIOD_S))


def odometry_sequence(sequence: Path) -> ScanStream:
    """A sequence of the odometry layout, .../sequences/00, with optional calib.txt, times.txt and poses.

    Its sweeps are published deskewed.
    """
    notes: list[str] = []
    pose_notes: list[str] = []
    calib = sequence / "calib.txt"
    cost = f"{NO_CAMERA}; get Tr from data_odometry_calib.zip"
    camera = _optional(kitti_calibration.camera_of_sequence, calib, notes, cost)
    places = (sequence / "poses.txt", sequence.parent.parent / "poses" / f"{sequence.name}.txt")
    path = next((p for p in places if not _absent(p)), None)
    poses: Poses = {}
    if path is None or camera is None:
        cause = f"{places[0]} {_absent(places[0])}" if path is None else f"{path} needs the Tr of {calib}"
        pose_notes.append(f"{cause}: {NO_POSES}")
    else:
        poses = dict(enumerate(sensor_poses(read_poses(path), camera.T_camera_sensor)))
    scans = _scans(sequence / "velodyne")
    stamps = _stamps(sequence / "times.txt", scans, notes, seconds_ns)
    info = StreamInfo(f"odometry {sequence.name}", "KITTI odometry", camera=camera)
    return _stream(info, scans, notes, pose_notes, poses, stamps, {})


def scan_folder(folder: Path, period_s: float = PERIOD_S, suffix: str = ".bin") -> ScanStream:
    """A folder of scans in the order of their names, stamped by their names or `period_s` apart."""
    scans = _scans(folder, suffix)
    times = times_ns([f.stem for f in scans.values()])
    apart = f"{period_s} s apart in the order of their names" if times is None else "stamped by their names"
    stamps = {i: i * period_s if times is None else (times[k] - times[0]) / 1e9 for k, i in enumerate(scans)}
    notes = [f"folder of scans: no calibration, frames {apart}"]
    began_s = 0.0 if times is None else times[0] / 1e9
    info = StreamInfo(folder.name, "folder of scans", period_s=period_s, began_s=began_s)
    poses: Poses = {}
    T_sensor_file: dict[int, Float64] = {}
    if suffix == ".pcd":
        from modt.sources.viewpoints import viewpoints_of

        viewpoints = viewpoints_of(scans)
        poses = viewpoints.poses
        T_sensor_file = viewpoints.T_sensor_file
        notes += viewpoints.notes
    pose_notes = [] if poses else [f"folder of scans: {NO_POSES}"]
    stream = _stream(info, scans, notes, pose_notes, poses, stamps, {})
    stream.scans = [replace(scan, T_sensor_file=T_sensor_file.get(scan.index)) for scan in stream.scans]
    return stream


def _scans(data: Path, suffix: str = ".bin") -> dict[int, Path]:
    """Files of the scans of a folder in their order, by index."""
    files = files_in(data, suffix)
    if not files:
        raise MisuseError(data, f"no {suffix} scans", "give a folder of scans")
    numbers = [int(f.stem) for f in files if re.fullmatch(f"[0-9]{{1,{MAX_NUMBER_DIGITS}}}", f.stem)]
    numbered = len(set(numbers)) == len(files) and times_ns([f.stem for f in files]) is None
    return dict(zip(numbers if numbered else range(len(files)), files, strict=True))


def _stream(
    info: StreamInfo,
    files: Mapping[int, Path],
    notes: list[str],
    pose_notes: list[str],
    poses: Poses,
    stamps: Mapping[int, float],
    turns: Mapping[int, float],
) -> ScanStream:
    """Stream of scan files with their poses, stamps and durations [s] by frame."""
    indices = list(files)
    missing = indices[-1] - indices[0] + 1 - len(indices)
    if missing:
        first = next(a + 1 for a, b in pairwise(indices) if b > a + 1)
        notes.append(f"{missing} frames are missing (the first is {first})")
    if poses:
        poses = _for_all(indices, poses, pose_notes)
    scans = [
        ScanReference(i, f, stamps.get(i, i * PERIOD_S), poses.get(i), turns.get(i, 0.0)) for i, f in files.items()
    ]
    if any(later.stamp_s < earlier.stamp_s for earlier, later in pairwise(scans)):
        notes.append(f"time stamps decrease: frames {PERIOD_S} s apart instead")
        scans = [replace(scan, stamp_s=scan.index * PERIOD_S) for scan in scans]
    info = replace(info, has_poses=bool(poses), notes=tuple(notes), pose_notes=tuple(pose_notes))
    return ScanStream(info, scans)


def _for_all(frames: Sequence[int], poses: Poses, notes: list[str]) -> Poses:
    """Pose of each frame: its own, else that of the frame before, else the first one."""
    without = [frame for frame in frames if frame not in poses]
    if without:
        cost = "have the pose of the frame before"
        notes.append(f"{len(without)} frames without a pose {cost} (the first is {without[0]})")
    known = sorted(poses)
    return {frame: poses[known[max(bisect_right(known, frame) - 1, 0)]] for frame in frames}


def _poses_of_raw(drive: Path, notes: list[str]) -> Poses:
    files = files_in(drive / "oxts" / "data", ".txt")
    records = [r for r in files if re.fullmatch("[0-9]+", r.stem) and r.stat().st_size]
    if not records:
        notes.append(f"{drive / 'oxts' / 'data'} is missing: {NO_POSES}")
        return {}
    T_imu_sensor = _optional(kitti_calibration.T_imu_sensor_of_raw, drive.parent, notes, NO_POSES)
    if T_imu_sensor is None:
        return {}
    first = [kitti_calibration.read_oxts(r)[0, : len(kitti_calibration.OXTS_FIELDS)] for r in records]
    T_world_imu = kitti_calibration.oxts_poses(np.array(first))
    return dict(zip((int(r.stem) for r in records), T_world_imu @ T_imu_sensor, strict=True))


def _stamps(
    path: Path, frames: Iterable[int], notes: list[str], read: Callable[[str], int | None]
) -> dict[int, float]:
    """Stamps of the frames since scan 0 [s]; missing ones are interpolated."""
    times = _times_ns(path, frames, f"frames {PERIOD_S} s apart", notes, "theirs are interpolated", read)
    if not times:
        return {}
    known = sorted(times)
    began = min(times.values())
    stamps_s = np.array([(times[i] - began) / 1e9 for i in known])
    period_s = float(np.median(np.diff(stamps_s) / np.diff(known))) if len(known) > 1 else PERIOD_S
    scans = np.array([0, *frames])
    beyond = np.minimum(scans - known[0], 0) + np.maximum(scans - known[-1], 0)
    first_s, *others_s = (np.interp(scans, known, stamps_s) + beyond * period_s).tolist()
    return {i: stamp_s - first_s for i, stamp_s in zip(frames, others_s, strict=True)}


def _raw_turns(folder: Path, frames: Iterable[int], notes: list[str]) -> dict[int, float]:
    """Durations of the sweeps by frame [s]; empty where the time stamps are missing or wrong."""
    starts = _times_ns(folder / "timestamps_start.txt", frames, NO_SWEEP_TIMES, notes)
    ends = _times_ns(folder / "timestamps_end.txt", frames, NO_SWEEP_TIMES, notes) if starts else {}
    turns = {i: (ends[i] - starts[i]) / 1e9 for i in frames if i in starts and i in ends}
    period_s = float(np.median(np.diff(list(starts.values())))) / 1e9 if len(starts) > 1 else PERIOD_S
    odd = [i for i, turn_s in turns.items() if not 0.0 <= turn_s <= MAX_SWEEP_PERIODS * period_s]
    if odd:
        impossible = f"a negative time or more than {MAX_SWEEP_PERIODS} periods"
        bad = f"{len(odd)} sweeps of {folder} last {impossible} (the first is {odd[0]})"
        notes.append(f"{bad}: {NO_SWEEP_TIMES}")
        return {}
    return turns


def _times_ns(
    path: Path,
    frames: Iterable[int],
    cost: str,
    notes: list[str],
    cost_of_few: str = "",
    read: Callable[[str], int | None] = time_ns,
) -> dict[int, int]:
    """Times of a KITTI list by frame [ns]; line i belongs to scan i and is blank where the scan is missing.

    A defect is noted with its cost; `cost_of_few` is the cost of single frames without a time.
    """
    if absent := _absent(path):
        notes.append(f"{path} {absent}: {cost}")
        return {}
    lines = path.read_text(encoding="utf-8", errors="replace").rstrip().split("\n")
    times = {i: time for i, time in enumerate(map(read, lines)) if time is not None}
    if not times:
        notes.append(f"{path} is no list of time stamps: {cost}")
        return {}
    n_scans = max(frames) + 1
    if len(lines) != n_scans:
        unlike = f"{path} has {len(lines)} lines, the last scan is number {n_scans - 1}"
        notes.append(f"{unlike}: line i is used for scan i, from 0; restore the missing lines")
    without = [i for i in frames if i not in times]
    if without:
        few = f"{len(without)} frames have no time in {path} (the first is {without[0]})"
        notes.append(f"{few}: {cost_of_few or cost}")
    return times


def _absent(path: Path) -> str:
    """Reason why a part of a recording is absent, empty if it is there; broken downloads leave empty files."""
    if not path.is_file():
        return "is missing"
    return "" if path.stat().st_size else "is empty"


def _optional(read: Callable[[Path], T], path: Path, notes: list[str], cost: str) -> T | None:
    """Read a calibration; None if its file or a row of it is missing, which is noted with its cost."""
    try:
        return read(path)
    except kitti_calibration.MissingError as error:
        notes.append(f"{error.subject}: {error.cause}: {cost}")
        return None
