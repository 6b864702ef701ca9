"""KITTI's calibration files and OXTS records: left colour camera, inertial unit and its poses.

A missing file or row of a calibration raises a MissingError, and an invalid one a MisuseError.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import Camera, inverse, rotation_zyx, se3
from modt.sources.text_file import read_lines
from modt.types import Float64

IMAGE_PX = np.array([1242.0, 375.0])
"""Width and height of the rectified image, for a calibration without them."""
REMEDY = "restore the calibration file"
MAX_ELEMENT = 1e6
"""Greatest number in a calibration [pixel or m]."""


class MissingError(MisuseError):
    """A calibration file or a row of it is missing; the recording is used without it."""


class Calibration:
    """Numeric rows of a file by key."""

    def __init__(self, path: Path) -> None:
        """Read a file.

        Raises:
            MissingError: the file does not exist.
        """
        if not path.is_file():
            raise MissingError(path, "is missing", REMEDY)
        self.path = path
        self.rows: dict[str, Float64] = {}
        for line in read_lines(path, REMEDY):
            key, _, values = line.replace(":", " ", 1).partition(" ")
            with suppress(ValueError):
                self.rows[key] = np.array(values.split(), dtype=np.float64)

    def matrix(self, rows: int, columns: int, *keys: str) -> Float64:
        """(rows, columns) matrix of the first known key, with numbers up to MAX_ELEMENT."""
        for key in keys:
            if key in self.rows:
                row = self.rows[key]
                if row.size != rows * columns:
                    raise MisuseError(self.path, f"{key} holds {row.size} numbers, not {rows * columns}", REMEDY)
                if not (np.abs(row) <= MAX_ELEMENT).all():
                    raise MisuseError(self.path, f"{key} holds a number beyond {MAX_ELEMENT:g}", REMEDY)
                return row.reshape(rows, columns)
        raise MissingError(self.path, f"no {' or '.join(keys)}", REMEDY)

    def rigid(self) -> Float64:
        """(4, 4) transform from R and T of a raw calibration."""
        return se3(self.matrix(3, 3, "R"), self.matrix(3, 1, "T")[:, 0])


def homogeneous(top: Float64) -> Float64:
    """(4, 4) homogeneous matrix of a (3, 3) or (3, 4) one."""
    out = np.eye(4)
    out[:3, : top.shape[1]] = top
    return out


def camera(P: Float64, R_rect: Float64, T_camera_sensor: Float64, size_px: Float64 = IMAGE_PX) -> Camera:
    """Camera of projection P (3, 4), rectification R_rect (3, 3) and pose T_camera_sensor (4, 4)."""
    T = homogeneous(R_rect) @ T_camera_sensor
    width_px, height_px = size_px.tolist()
    return Camera(P @ T, T, width_px, height_px)


def camera_of_raw(path: Path) -> Camera:
    """Left colour camera from calib_cam_to_cam.txt and the calib_velo_to_cam.txt in the same folder."""
    cameras = Calibration(path)
    cameras.rows.setdefault("S_rect_02", IMAGE_PX)
    size_px = cameras.matrix(1, 2, "S_rect_02")[0]
    P = cameras.matrix(3, 4, "P_rect_02")
    R_rect = cameras.matrix(3, 3, "R_rect_00")
    return camera(P, R_rect, Calibration(path.with_name("calib_velo_to_cam.txt")).rigid(), size_px)


def camera_of_sequence(path: Path) -> Camera:
    """Left colour camera from a calibration file of the tracking, object or odometry layout."""
    calibration = Calibration(path)
    calibration.rows.setdefault("R_rect", np.eye(3))  # Tr of the odometry layout includes the rectification
    R_rect = calibration.matrix(3, 3, "R0_rect", "R_rect")
    T_camera_sensor = homogeneous(calibration.matrix(3, 4, "Tr_velo_to_cam", "Tr_velo_cam", "Tr"))
    return camera(calibration.matrix(3, 4, "P2"), R_rect, T_camera_sensor)


def T_imu_sensor_of_raw(folder: Path) -> Float64:
    """(4, 4) T_imu_sensor from calib_imu_to_velo.txt."""
    return inverse(Calibration(folder / "calib_imu_to_velo.txt").rigid())


def T_imu_sensor_of_sequence(path: Path) -> Float64:
    """(4, 4) T_imu_sensor from a calibration file of the tracking or object layout."""
    return inverse(homogeneous(Calibration(path).matrix(3, 4, "Tr_imu_to_velo", "Tr_imu_velo")))


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
