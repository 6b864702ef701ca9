"""Scan files (KITTI's float32 rows of x, y, z, reflectance; PCD and PLY), and streams of them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from modt.errors import MisuseError, ModtError, ScanError
from modt.sources.stream import Faults, Reading, StreamInfo
from modt.types import COMPENSATED, DESKEWED, UNRECORDED, Float32, Float64, Frame, Self

SUFFIXES = (".bin", ".pcd", ".ply")
"""Suffixes of scan files; a folder that holds several kinds is read by the first one."""
COLUMNS = 4
"""Float32 numbers of a point in a file of KITTI."""
NUSCENES_COLUMNS = 5
"""Float32 numbers of a point in a file of nuScenes (`.pcd.bin`): x to the right, y forward; the fifth is the beam."""
MAX_BYTES = 256 << 20
MAX_COORDINATE_M = 1000.0
MAX_IMPLAUSIBLE_SHARE = 0.02
"""Greatest share of implausible rows in a valid scan."""


def read_scan(path: Path, T_sensor_file: Float64 | None = None) -> tuple[Float32, list[str]]:
    """Points of a scan file in the sensor's frame, and its flaws. `T_sensor_file` places those of a PCD file.

    Points that are not finite, or far beyond any range, are set to the origin, which counts as no return, so that
    rows keep their indices. A reflectance that is not finite or negative counts as not recorded. Reflectances from 0
    to 255 are scaled to 0 to 1.

    Raises:
        ScanError: the file is missing, unreadable, empty or truncated, or has other columns.
    """
    try:
        with path.open("rb") as file:
            raw = file.read(min(os.fstat(file.fileno()).st_size, MAX_BYTES) + 1)  # no larger buffer than the file
    except OSError as error:
        raise ScanError(path, f"cannot be read ({error.strerror})", "the frame is skipped") from None
    if not raw:
        raise ScanError(path, "empty scan", "the frame is skipped; record it again")
    if len(raw) > MAX_BYTES:
        cause = f"larger than {MAX_BYTES >> 20} MiB"
        raise ScanError(path, cause, "the frame is skipped; it is no sweep of a sensor")
    if path.suffix == ".feather":
        points = _read_feather(path, T_sensor_file)
    elif path.suffix in (".pcd", ".ply"):
        points = _read_cloud(path, raw, T_sensor_file)
    else:
        points = _read_rows(path, raw)
    return sanitised(points, path)


def _read_feather(path: Path, T_sensor_file: Float64 | None) -> Float32:
    from modt.sources.argoverse import read_sweep

    try:
        return read_sweep(path, T_sensor_file)
    except MisuseError as error:
        raise ScanError(path, error.cause, "the frame is skipped; restore it") from None


def _read_cloud(path: Path, raw: bytes, T_sensor_file: Float64 | None) -> Float32:
    from modt.sources.point_cloud_file import CloudError, read_pcd, read_ply

    try:
        return read_pcd(raw, T_sensor_file) if path.suffix == ".pcd" else read_ply(raw)
    except CloudError as error:
        remedy = "the frame is skipped; convert it to x, y, z [m] and reflectance"
        raise ScanError(path, str(error), remedy) from None


def _read_rows(path: Path, raw: bytes) -> Float32:
    columns = NUSCENES_COLUMNS if path.name.endswith(".pcd.bin") else COLUMNS
    if len(raw) % (4 * columns):
        cause = f"truncated: {len(raw)} bytes are no multiple of {4 * columns}-byte rows"
        raise ScanError(path, cause, "the frame is skipped; copy it again, or convert it to x, y, z, reflectance")
    points = np.frombuffer(raw, np.float32).reshape(-1, columns)[:, :COLUMNS].copy()
    if columns == NUSCENES_COLUMNS:
        points[:, :2] = points[:, 1::-1]
        points[:, 1] *= -1
    return points


def sanitised(points: Float32, origin: object) -> tuple[Float32, list[str]]:
    """Points with finite values, corrected in place, and their flaws.

    Raises:
        ScanError: the columns are not x, y, z, reflectance.
    """
    if _flawless(points):
        return points, []
    flaws = [] if np.isfinite(points).all() else _made_finite(points)
    reflectance = points[:, 3]
    negative = np.flatnonzero(reflectance < 0)
    implausible = np.count_nonzero(reflectance[negative] != UNRECORDED) + np.count_nonzero(reflectance > 255)
    far = (np.abs(points[:, :3]) > MAX_COORDINATE_M).any(axis=1)
    implausible += np.count_nonzero(far)
    if implausible > MAX_IMPLAUSIBLE_SHARE * len(points):
        cause = "its columns are not x, y, z [m], reflectance"
        raise ScanError(origin, cause, "the frame is skipped; convert it to float32 rows of these four")
    points[far] = 0.0
    if reflectance.max(initial=0.0) > 1.0:  # 0 to 255, unless only a few outliers exceed 1
        in_bytes = np.count_nonzero(reflectance > 1.0) > MAX_IMPLAUSIBLE_SHARE * (len(points) - len(negative))
        np.clip(reflectance / np.float32(255 if in_bytes else 1), 0, 1, out=reflectance)
    reflectance[negative] = UNRECORDED
    return points, flaws


def _made_finite(points: Float32) -> list[str]:
    """Flaws of points that are not finite, which are corrected in place."""
    flaws = []
    broken = np.flatnonzero(~np.isfinite(points[:, :3]).all(axis=1))
    points[broken] = 0.0
    unlit = np.flatnonzero(~np.isfinite(points[:, 3]))
    points[unlit, 3] = UNRECORDED
    if len(broken):
        flaws.append(f"{len(broken)} points are not finite and count as no return")
    if len(unlit):
        unread = f"{len(unlit)} reflectances are not finite and count as not recorded"
        flaws.append(f"{unread}: have the sensor's driver write them")
    return flaws


def _flawless(points: Float32) -> bool:
    """Whether nothing must be corrected; a NaN makes its reduction NaN, so that the comparison fails."""
    reflectance = points[:, 3].copy()  # contiguous, for faster reductions
    with np.errstate(invalid="ignore"):
        coordinates = points.min(initial=0.0) >= -MAX_COORDINATE_M and points.max(initial=0.0) <= MAX_COORDINATE_M
        return bool(coordinates and reflectance.min(initial=0.0) >= 0.0 and reflectance.max(initial=0.0) <= 1.0)


PERIOD_S = 0.1
"""Time between scans that have no stamps [s]."""
NO_POSES = "no odometry, ego-motion is estimated from the proposals"
"""Consequence of missing poses, for notes."""


@dataclass(frozen=True)
class ScanReference:
    """A scan on disk."""

    index: int  # frame number
    path: Path  # the file
    stamp_s: float  # its time [s]
    T_world_sensor: Float64 | None  # (4, 4) pose, None where unknown
    turn_s: float = 0.0  # duration of the sweep [s], as in Frame
    T_sensor_file: Float64 | None = None  # (4, 4) transform of its points to the sensor's frame, None for those in it


class ScanStream:
    """Frames of scan files, ordered by time; unusable scans are counted and skipped, the first ones are logged."""

    def __init__(self, info: StreamInfo, scans: list[ScanReference]) -> None:
        self.info = replace(info, n_frames=len(scans), end=scans[-1].index + 1 if scans else 0)
        self.scans = scans
        self.faults = Faults()
        self.reading = Reading()

    def __iter__(self) -> Iterator[Frame]:
        self.reading = Reading(poses="the recording" if self.info.has_poses else "")
        used = 0
        for scan in self.scans:
            self.reading.messages += 1
            self.reading.sweeps += 1
            self.reading.times[DESKEWED if scan.turn_s else COMPENSATED] += 1
            try:
                points, flaws = read_scan(scan.path, scan.T_sensor_file)
            except ScanError as error:
                self.faults.report(scan.index, scan.path, error.cause, skipped=True)
                continue
            if flaws:
                self.faults.report(scan.index, scan.path, "; ".join(flaws), skipped=False)
            used += 1
            yield Frame(scan.index, scan.stamp_s, points, scan.T_world_sensor, turn_s=scan.turn_s)
        if self.scans and not used:
            cause = f"none of its {len(self.scans)} scans can be used ({self.faults.first[0].cause})"
            raise ModtError(self.info.name, cause, "give a stream of float32 x, y, z, reflectance scans")

    def between(self, first: int, last: int | None) -> Self:
        """Scans with first <= index < last; others are not read."""
        return type(self)(self.info, [s for s in self.scans if s.index >= first and (last is None or s.index < last)])
