"""Logs of Argoverse 2: sweeps, poses and calibration in feather files, which pyarrow reads."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from modt.errors import MisuseError, install
from modt.geometry import inverse, rotation_of, se3
from modt.sources.file_names import files_in
from modt.sources.point_cloud_file import points_of
from modt.sources.scan_file import NO_POSES, ScanReference, ScanStream
from modt.sources.stream import StreamInfo
from modt.types import Float32, Float64

SWEEPS = Path("sensors/lidar")
POSES = "city_SE3_egovehicle.feather"
CALIBRATION = Path("calibration/egovehicle_SE3_sensor.feather")
LIDAR = "up_lidar"
PLACEMENT = ("qx", "qy", "qz", "qw", "tx_m", "ty_m", "tz_m")
Columns = dict[str, Any]


def log_of(path: Path) -> Path | None:
    """Folder of the log that a folder is, or that it lies in; None if it is none."""
    found = next((log for log in (path, *list(path.parents)[:2]) if (log / SWEEPS).is_dir()), None)
    return found if found is not None and path in (found, found / SWEEPS.parent, found / SWEEPS) else None


def open_log(log: Path) -> ScanStream:
    """Stream of a log, whose sweeps are compensated for the motion of the vehicle.

    Points are in a frame with the axes of the vehicle and the origin of the upper of its two sensors.

    Raises:
        MisuseError: pyarrow is missing, there are no sweeps, or a file is broken.
    """
    files = [file for file in files_in(log / SWEEPS, ".feather") if file.stem.isdecimal()]
    if not files:
        raise MisuseError(log / SWEEPS, "no sweeps", "unpack the log's sensors/lidar/*.feather")
    times_ns = [int(file.stem) for file in files]
    T_vehicle_sensor = sensor_in_vehicle(log)
    notes = (
        [] if T_vehicle_sensor is not None else [f"{log / CALIBRATION} is missing: its sensor counts as the origin"]
    )
    T_vehicle_sensor = np.eye(4) if T_vehicle_sensor is None else T_vehicle_sensor
    poses = poses_of(log)
    without = [time_ns for time_ns in times_ns if time_ns not in poses]
    if without:
        notes.append(f"{log / POSES} lacks {len(without)} sweeps (the first is {without[0]}): {NO_POSES}")
        poses = {}
    T_sensor_vehicle = inverse(T_vehicle_sensor)
    scans = [
        ScanReference(
            i,
            file,
            (time_ns - times_ns[0]) / 1e9,
            poses[time_ns] @ T_vehicle_sensor if poses else None,
            T_sensor_file=T_sensor_vehicle,
        )
        for i, (file, time_ns) in enumerate(zip(files, times_ns, strict=True))
    ]
    gaps_s = [(b - a) / 1e9 for a, b in pairwise(times_ns)]
    period_s = round(median(gaps_s), 3) if gaps_s else 0.1
    info = StreamInfo(log.name, "Argoverse 2 log", period_s=period_s, has_poses=bool(poses), notes=tuple(notes))
    return ScanStream(info, scans)


def sensor_in_vehicle(log: Path) -> Float64 | None:
    """(4, 4) transform from the frame of the points to that of the vehicle; None where it is not known."""
    path = log / CALIBRATION
    if not path.is_file():
        return None
    table = read_columns(path, ("sensor_name", *PLACEMENT))
    place = next((k for k, name in enumerate(table["sensor_name"]) if name == LIDAR), None)
    if place is None:
        return None
    return se3(np.eye(3), placements(path, table)[place][:3, 3])


def poses_of(log: Path) -> dict[int, Float64]:
    """(4, 4) pose of the vehicle in the city by time [ns]; empty without the file."""
    path = log / POSES
    if not path.is_file():
        return {}
    table = read_columns(path, ("timestamp_ns", *PLACEMENT))
    return dict(zip(table["timestamp_ns"].tolist(), placements(path, table), strict=True))


def placements(path: Path, table: Columns) -> list[Float64]:
    """(4, 4) transforms of the rows of a table."""
    rows = np.column_stack([table[name] for name in PLACEMENT]).astype(np.float64)
    if not np.isfinite(rows).all() or not np.abs(rows[:, :4]).any(axis=1).all():
        raise MisuseError(path, "holds a pose that is none", "restore the file")
    return [se3(rotation_of(row[:4]), row[4:]) for row in rows]


def read_columns(path: Path, names: tuple[str, ...]) -> Columns:
    """Columns of a feather file as arrays of NumPy.

    Raises:
        MisuseError: pyarrow is missing, or the file cannot be read or lacks a column.
    """
    try:
        from pyarrow import ArrowException, feather
    except ModuleNotFoundError as error:
        raise MisuseError(path, f"needs {error.name}", install("parquet")) from None
    try:
        table = feather.read_table(path, columns=list(names), memory_map=False, use_threads=False)
        return {name: table.column(name).to_numpy() for name in names}
    except (OSError, ArrowException, KeyError) as error:
        raise MisuseError(
            path, f"cannot be read ({' '.join(str(error).split())[:120]})", "restore the file"
        ) from None


def read_sweep(path: Path, T_sensor_vehicle: Float64 | None) -> Float32:
    """(N, 4) points and reflectance of a sweep; they stay in the vehicle's frame without a (4, 4) transform.

    Raises:
        MisuseError: as `read_columns`.
    """
    return points_of(read_columns(path, ("x", "y", "z", "intensity")), T_sensor_vehicle)
