"""One scan in KITTI's format: float32 rows of x, y, z, reflectance."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.errors import ScanError
from modt.types import UNRECORDED, Float32

ROW_BYTES = 16
FARTHEST_M = 1000.0
TOLERATED_SHARE = 0.02
"""Share of rows that may be implausible before the file is taken for something else."""


def read_scan(path: Path) -> tuple[Float32, list[str]]:
    """Points of a .bin file, and what was wrong with some of them.

    Points that are not finite are set to the origin, where nothing is ever measured, so that every row keeps its
    place; of a point whose reflectance alone is not finite, or negative, none was recorded. Reflectances given as
    0 to 255 are brought to 0 to 1.

    Raises:
        ScanError: missing, unreadable, empty, truncated, or rows of something else.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise ScanError(path, f"cannot be read ({error.strerror})", "the frame is skipped") from None
    if not raw:
        raise ScanError(path, "empty scan", "the frame is skipped; record it again")
    if len(raw) % ROW_BYTES:
        cause = f"truncated: {len(raw)} bytes are no whole number of {ROW_BYTES}-byte rows"
        raise ScanError(
            path, cause, "the frame is skipped; copy the file again, or convert it to x, y, z, reflectance"
        )
    points = np.frombuffer(raw, np.float32).reshape(-1, 4).copy()
    return sanitised(points, path)


def sanitised(points: Float32, origin: object) -> tuple[Float32, list[str]]:
    """Points without anything that is not finite, mended in place, and what there was of it.

    Raises:
        ScanError: the columns are not x, y, z, reflectance.
    """
    flaws, reflectance = [], points[:, 3]
    # One sum finds any NaN or infinity at a tenth of the price of looking at each value.
    if not np.isfinite(points.sum(dtype=np.float64)):
        broken = np.flatnonzero(~np.isfinite(points[:, :3]).all(axis=1))
        points[broken] = 0.0
        lacking = np.flatnonzero(~np.isfinite(reflectance))
        reflectance[lacking] = UNRECORDED
        if len(broken):
            flaws.append(f"{len(broken)} points are not finite and count as no return")
        if len(lacking):
            unread = f"{len(lacking)} reflectances are not finite and count as not recorded"
            flaws.append(f"{unread}: have the sensor's driver write them")
    negative = np.flatnonzero(reflectance < 0)
    odd = np.count_nonzero(reflectance[negative] != UNRECORDED) + np.count_nonzero(reflectance > 255)
    odd += np.count_nonzero(np.abs(points[:, :3]) > FARTHEST_M)
    if odd > TOLERATED_SHARE * len(points):
        cause = "its columns are not x, y, z [m], reflectance"
        raise ScanError(origin, cause, "the frame is skipped; convert it to float32 rows of these four")
    if reflectance.max(initial=0.0) > 1.0:  # 0 to 255, unless a few strays alone are beyond 1
        in_bytes = np.count_nonzero(reflectance > 1.0) > TOLERATED_SHARE * (len(points) - len(negative))
        np.clip(reflectance / np.float32(255 if in_bytes else 1), 0, 1, out=reflectance)
    reflectance[negative] = UNRECORDED
    return points, flaws
