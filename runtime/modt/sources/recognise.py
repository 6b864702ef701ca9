"""Recognition of the layout at a path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from modt.errors import MisuseError
from modt.sources import kitti
from modt.sources.scan_stream import ScanStream

MAX_LISTED = 5
"""Greatest number of candidates in an error message."""


def _raw(path: Path) -> bool:
    return (path / "velodyne_points").is_dir()


def _raw_inside(path: Path) -> bool:
    return path.name == "velodyne_points" or (path.parent.name == "velodyne_points" and path.name == "data")


def _tracking(path: Path) -> bool:
    return path.parent.name == "velodyne" and path.name.isdigit() and _has_scans(path)


def _odometry(path: Path) -> bool:
    return _has_scans(path / "velodyne")


def _odometry_inside(path: Path) -> bool:
    return path.name == "velodyne" and (path.parent / "calib.txt").is_file() and _has_scans(path)


def _has_scans(path: Path) -> bool:
    return path.is_dir() and next(path.glob("*.bin"), None) is not None


def _drive_of(path: Path) -> Path:
    return path.parent if path.name == "velodyne_points" else path.parent.parent


LAYOUTS: tuple[tuple[Callable[[Path], bool], Callable[[Path], ScanStream]], ...] = (
    (_raw, kitti.raw_drive),
    (_raw_inside, lambda path: kitti.raw_drive(_drive_of(path))),
    (_tracking, kitti.tracking_sequence),
    (_odometry, kitti.odometry_sequence),
    (_odometry_inside, lambda path: kitti.odometry_sequence(path.parent)),
    (_has_scans, kitti.scan_folder),
)
"""Test and reader of each layout, the most specific first."""


def open_stream(path: Path) -> ScanStream:
    """The stream at a path.

    Raises:
        MisuseError: the path does not exist or holds no stream; the error names streams below it.
    """
    if not path.exists():
        raise MisuseError(
            path, "no such file or directory", "give a KITTI drive, a sequence or a folder of .bin scans"
        )
    path = path.resolve()
    for matches, read in LAYOUTS:
        if path.is_dir() and matches(path):
            return read(path)
    if (path / "oxts").is_dir():
        raise MisuseError(
            path / "velodyne_points", "missing from this raw drive", "unpack all synced data of the drive"
        )
    nearby = _nearby(path)
    if nearby:
        more = f" (and {len(nearby) - MAX_LISTED} more)" if len(nearby) > MAX_LISTED else ""
        raise MisuseError(
            path, "holds several streams", f"give one: {', '.join(map(str, nearby[:MAX_LISTED]))}{more}"
        )
    raise MisuseError(path, "no stream of scans", "give a KITTI drive, a sequence or a folder of .bin scans")


def _nearby(path: Path) -> list[Path]:
    """Streams up to three levels below."""
    if not path.is_dir():
        return []
    below = [p for depth in ("*", "*/*", "*/*/*") for p in sorted(path.glob(depth)) if p.is_dir()]
    return [p for p in below if _raw(p) or _tracking(p) or (_odometry(p) and not p.name.startswith("velodyne"))]
