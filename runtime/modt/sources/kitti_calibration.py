"""KITTI's calibration files and OXTS records: left colour camera, inertial unit and its poses.

All readers of calibrations raise a MissingError for a missing file or row, and a MisuseError for an invalid one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera, inverse, rotation_zyx, se3
from modt.sources.text_file import read_lines
from modt.types import Float64

IMAGE_PX = (1242.0, 375.0)
"""Size of the rectified image, for a calibration without one."""
REMEDY = "restore the calibration file"
MAX_ELEMENT = 1e6
"""Greatest number in a calibration [pixel or m]."""


class MissingError(MisuseError):
    """A calibration file or a row of it is missing; the recording is used without it."""


def read_table(path: Path) -> dict[str, Float64]:
    """Numeric rows by key.

    Raises:
        MissingError: the file does not exist.
    """
    if not path.is_file():
        raise MissingError(path, "is missing", REMEDY)
    table: dict[str, Float64] = {}
    for line in read_lines(path, REMEDY):
        key, _, values = line.replace(":", " ", 1).partition(" ")
        try:
            table[key] = np.array(values.split(), dtype=np.float64)
        except ValueError:
            continue
    return table


def matrix(table: dict[str, Float64], path: Path, shape: tuple[int, int], *keys: str) -> Float64:
    """Matrix of the first known key, with numbers up to MAX_ELEMENT."""
    for key in keys:
        if key in table:
            if table[key].size != shape[0] * shape[1]:
                cause = f"{key} holds {table[key].size} numbers, not {shape[0] * shape[1]}"
                raise MisuseError(path, cause, REMEDY)
            if not (np.abs(table[key]) <= MAX_ELEMENT).all():
                raise MisuseError(path, f"{key} holds a number beyond {MAX_ELEMENT:g}", REMEDY)
            return table[key].reshape(shape)
    raise MissingError(path, f"no {' or '.join(keys)}", REMEDY)


def rigid(table: dict[str, Float64], path: Path) -> Float64:
    """(4, 4) transform from R and T of a raw calibration."""
    return se3(matrix(table, path, (3, 3), "R"), matrix(table, path, (3, 1), "T")[:, 0])


def homogeneous(top: Float64) -> Float64:
    """(4, 4) homogeneous matrix of a (3, 3) or (3, 4) one."""
    out = np.eye(4)
    out[:3, : top.shape[1]] = top
    return out


def camera(P: Float64, R_rect: Float64, T_camera_sensor: Float64, size_px: tuple[float, float] = IMAGE_PX) -> Camera:
    """Camera of projection P (3, 4), rectification R_rect (3, 3) and pose T_camera_sensor (4, 4)."""
    T = homogeneous(R_rect) @ T_camera_sensor
    return Camera(P @ T, T, size_px[0], size_px[1])


def camera_of_raw(path: Path) -> Camera:
    """Left colour camera from calib_cam_to_cam.txt and the calib_velo_to_cam.txt in the same folder."""
    table = read_table(path)
    size = matrix({"S_rect_02": np.array(IMAGE_PX)} | table, path, (1, 2), "S_rect_02")[0]
    to_camera = path.with_name("calib_velo_to_cam.txt")
    return camera(
        matrix(table, path, (3, 4), "P_rect_02"),
        matrix(table, path, (3, 3), "R_rect_00"),
        rigid(read_table(to_camera), to_camera),
        (float(size[0]), float(size[1])),
    )


def camera_of_sequence(path: Path) -> Camera:
    """Left colour camera from a calibration file of the tracking, object or odometry layout."""
    table = read_table(path)
    unrectified = {"R_rect": np.eye(3)}  # Tr of the odometry layout includes the rectification
    R_rect = matrix(unrectified | table, path, (3, 3), "R0_rect", "R_rect")
    T = homogeneous(matrix(table, path, (3, 4), "Tr_velo_to_cam", "Tr_velo_cam", "Tr"))
    return camera(matrix(table, path, (3, 4), "P2"), R_rect, T)


def T_imu_sensor_of_raw(folder: Path) -> Float64:
    """(4, 4) T_imu_sensor from calib_imu_to_velo.txt."""
    path = folder / "calib_imu_to_velo.txt"
    return inverse(rigid(read_table(path), path))


def T_imu_sensor_of_sequence(path: Path) -> Float64:
    """(4, 4) T_imu_sensor from a calibration file of the tracking or object layout."""
    table = read_table(path)
    return inverse(homogeneous(matrix(table, path, (3, 4), "Tr_imu_to_velo", "Tr_imu_velo")))


EARTH_RADIUS_M = 6378137.0
OXTS_FIELDS = ("lat", "lon", "alt", "roll", "pitch", "yaw")
MAX_OXTS = (85.0, 360.0, 1e5, 7.0, 7.0, 7.0)
"""Greatest absolute value of each field; Mercator's projection excludes the poles."""
OXTS_REMEDY = "restore it, or remove it to run without ego-motion"


def oxts_poses(records: Float64) -> Float64:
    """(n, 4, 4) T_world_imu of (n, 6 or more) OXTS records: lat, lon [deg], alt [m], roll, pitch, yaw [rad].

    As in KITTI's development kit, Mercator coordinates are scaled at the first latitude, and the world frame is that
    of the first record.
    """
    lat, lon, alt, roll, pitch, yaw = records[:, :6].T
    scale = np.cos(np.deg2rad(lat[0]))
    x = scale * EARTH_RADIUS_M * np.deg2rad(lon)
    y = scale * EARTH_RADIUS_M * np.log(np.tan(np.deg2rad(90.0 + lat) / 2))
    T_mercator_imu = np.stack(
        [
            se3(rotation_zyx(*angles), np.array(position))
            for angles, position in zip(np.c_[roll, pitch, yaw], np.c_[x, y, alt], strict=True)
        ]
    )
    return np.asarray(inverse(T_mercator_imu[0]) @ T_mercator_imu)


def read_oxts(path: Path) -> Float64:
    """(n, k) OXTS records of a file, one a line, OXTS_FIELDS first.

    Raises:
        MisuseError: the file is missing, holds no records, or holds values that no place on Earth has.
    """
    rows = [line.split() for line in read_lines(path, OXTS_REMEDY)]
    try:
        records = np.array(rows, dtype=np.float64).reshape(len(rows), -1)
    except ValueError:
        raise MisuseError(path, "is no table of numbers", OXTS_REMEDY) from None
    if records.shape[1] < len(OXTS_FIELDS) or not np.isfinite(records[:, : len(OXTS_FIELDS)]).all():
        raise MisuseError(path, f"OXTS record without {', '.join(OXTS_FIELDS)}", OXTS_REMEDY)
    beyond = np.flatnonzero((np.abs(records[:, : len(OXTS_FIELDS)]) > MAX_OXTS).any(axis=0))
    if len(beyond):
        field = beyond[0]
        raise MisuseError(path, f"OXTS record of {OXTS_FIELDS[field]} beyond {MAX_OXTS[field]:g}", OXTS_REMEDY)
    return records
