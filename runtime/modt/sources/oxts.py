"""Poses from OXTS records, as defined by KITTI's development kit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import inverse, rotation_zyx, se3
from modt.types import Float64

EARTH_RADIUS_M = 6378137.0
FIELDS = ("lat", "lon", "alt", "roll", "pitch", "yaw")


def poses(records: Float64) -> Float64:
    """(n, 4, 4) T_world_imu of (n, 6 or more) records: lat, lon [deg], alt [m], roll, pitch, yaw [rad].

    Mercator coordinates scaled at the first latitude; the world frame is that of the first record.
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
    relative: Float64 = inverse(T_mercator_imu[0]) @ T_mercator_imu
    return relative


def read_record(path: Path) -> Float64:
    """(30,) values of a record of a raw drive.

    Raises:
        MisuseError: missing or no record.
    """
    try:
        numbers = np.array(path.read_text(encoding="ascii").split(), dtype=np.float64)
    except (OSError, ValueError):
        raise MisuseError(path, "is no OXTS record", "restore it, or run without oxts/") from None
    record: Float64 = _checked(numbers[None], path)[0]
    return record


def read_sequence(path: Path) -> Float64:
    """(n, 30) records of a tracking sequence, one per line.

    Raises:
        MisuseError: missing or no records.
    """
    try:
        return _checked(np.loadtxt(path, dtype=np.float64, ndmin=2), path)
    except (OSError, ValueError):
        raise MisuseError(path, "holds no OXTS records", "restore or remove it, to run without ego-motion") from None


def _checked(records: Float64, path: Path) -> Float64:
    if records.shape[1] < len(FIELDS) or not np.isfinite(records[:, : len(FIELDS)]).all():
        raise MisuseError(path, f"OXTS record without {', '.join(FIELDS)}", "restore it, or run without oxts/")
    return records
