"""Poses from OXTS records, as defined by KITTI's development kit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import MisuseError
from modt.geometry import inverse, rotation_zyx, se3
from modt.sources.text_file import read_lines
from modt.types import Float64

EARTH_RADIUS_M = 6378137.0
FIELDS = ("lat", "lon", "alt", "roll", "pitch", "yaw")
MOST = (85.0, 360.0, 1e5, 7.0, 7.0, 7.0)
"""Greatest absolute value of each field; Mercator's projection excludes the poles."""
REMEDY = "restore it, or remove it to run without ego-motion"


def poses(records: Float64) -> Float64:
    """(n, 4, 4) T_world_imu of (n, 6 or more) records: lat, lon [deg], alt [m], roll, pitch, yaw [rad].

    Mercator coordinates are scaled at the first latitude; the world frame is that of the first record.
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


def read_records(path: Path) -> Float64:
    """(n, k) records of a file, one a line, FIELDS first.

    Raises:
        MisuseError: the file is missing, holds no records, or holds values that no place on Earth has.
    """
    rows = [line.split() for line in read_lines(path, REMEDY)]
    try:
        records = np.array(rows, dtype=np.float64).reshape(len(rows), -1)
    except ValueError:
        raise MisuseError(path, "is no table of numbers", REMEDY) from None
    if records.shape[1] < len(FIELDS) or not np.isfinite(records[:, : len(FIELDS)]).all():
        raise MisuseError(path, f"OXTS record without {', '.join(FIELDS)}", REMEDY)
    beyond = np.flatnonzero((np.abs(records[:, : len(FIELDS)]) > MOST).any(axis=0))
    if len(beyond):
        field, most = FIELDS[beyond[0]], MOST[beyond[0]]
        raise MisuseError(path, f"OXTS record of {field} beyond {most:g}", REMEDY)
    return records
