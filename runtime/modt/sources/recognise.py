"""Recognition of the recording at a path."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import product
from pathlib import Path
from types import MappingProxyType

from modt.errors import MisuseError
from modt.sources.scan_file import PERIOD_S, SUFFIXES, ScanStream
from modt.sources.stream import Stream

CAPTURES = frozenset({".pcap", ".cap", ".pcapng"})
"""Suffixes of captures, in small letters as those of recordings."""
BAGS = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
"""Suffixes of the files of ROS 2 recordings."""
_LAS = ("is a LAS file", "convert it: pdal translate FILE scans/000000.ply, one file a sweep, and give scans")
_TO_ROWS = "[:, :4].astype('f4').tofile('scans/000000.bin'), columns x, y, z, reflectance"
_TEXT = ("is a table of text", f"convert it: numpy.loadtxt(FILE){_TO_ROWS}")
_LIVOX = ("is a recording of Livox Viewer", "record the packets instead: tcpdump -w FILE.pcap udp port 56301")
_PACKED = ("is compressed", "unpack it and give what was in it")
FOREIGN = {
    ".gz": _PACKED,
    ".zip": _PACKED,
    ".tar": _PACKED,
    ".bag": ("is a recording of ROS 1", "pip install rosbags; rosbags-convert --src FILE --dst FOLDER; give FOLDER"),
    ".las": _LAS,
    ".laz": _LAS,
    ".npy": ("is an array of NumPy", f"convert it: numpy.load(FILE){_TO_ROWS}"),
    ".xyz": _TEXT,
    ".pts": _TEXT,
    ".osf": ("is a recording of Ouster's SDK", "convert it: ouster-cli source FILE save OUT.pcap"),
    ".lvx": _LIVOX,
    ".lvx2": _LIVOX,
}
"""Cause and remedy for well-known files that are not read, by suffix."""
MAX_LISTED = 5
"""Greatest number of candidates in an error message."""
REMEDY = (
    "give a KITTI drive, a sequence, a scene of nuScenes, a log of Argoverse 2, a folder of .bin, .pcd or .ply "
    "scans, a PCAP file or a recording of ROS 2"
)


def open_stream(path: Path, period_s: float = PERIOD_S, capture: Mapping[str, str] = MappingProxyType({})) -> Stream:
    """Stream at a path: packets, a recording of ROS 2, or scan files.

    `capture` adds facts that the recording does not hold: options of `open_capture` or of `open_bag`.

    Raises:
        MisuseError: the path does not exist or holds no stream, or an option does not apply.
        ModtError: the recording cannot be read.
    """
    if path.is_file() and path.suffix.lower() in CAPTURES:
        from modt.sources.capture import CHOICES, open_capture
        from modt.sources.drivers import all_drivers

        _only(path, capture, {option for driver in all_drivers() for option in driver.options} | CHOICES)
        return open_capture(path, capture)
    if _is_bag(path):
        from modt.sources.bag import OPTIONS, open_bag

        _only(path, capture, OPTIONS)
        return open_bag(path, period_s, capture)
    _only(path, capture, set())
    return open_scans(path, period_s)


def _refuse_foreign(path: Path) -> None:
    """Raise MisuseError for a well-known file that is not read, or a folder of such files."""
    files = [p for p in (path.iterdir() if path.is_dir() else [path]) if not p.name.startswith(".")]
    suffixes = {p.suffix.lower() for p in files}
    if len(suffixes) == 1 and (known := FOREIGN.get(suffixes.pop())):
        cause, remedy = known
        raise MisuseError(path, cause if path.is_file() else f"each file in it {cause}", remedy)


def _only(path: Path, capture: Mapping[str, str], known: Collection[str]) -> None:
    unknown = sorted(set(capture) - set(known))
    if unknown:
        remedy = f"--capture takes {', '.join(sorted(known))} here" if known else "leave --capture out"
        raise MisuseError(path, f"{unknown[0]} does not apply", remedy)


def open_scans(path: Path, period_s: float = PERIOD_S) -> ScanStream:
    """Stream of scan files at a path; `period_s` is the time between the scans of a folder without stamps.

    Raises:
        MisuseError: the path does not exist or holds no stream; the error names streams below it.
    """
    if (dataset := _dataset(path)) is not None:
        return dataset
    if not path.exists():
        raise MisuseError(path, "no such file or directory", REMEDY)
    _refuse_foreign(path)
    path = path.resolve()
    stream = _stream(path, period_s)
    if stream is not None:
        return stream
    if (path / "oxts").is_dir():
        scans = path / "velodyne_points"
        raise MisuseError(scans, "missing from this raw drive", "unpack all synced data of the drive")
    nearby = _nearby(path)
    if nearby:
        more = f" (and {len(nearby) - MAX_LISTED} more)" if len(nearby) > MAX_LISTED else ""
        remedy = f"give one: {', '.join(map(str, nearby[:MAX_LISTED]))}{more}"
        cause = "holds several streams" if len(nearby) > 1 else "holds a stream further down"
        raise MisuseError(path, cause, remedy)
    raise MisuseError(path, "no stream of scans", REMEDY)


def _dataset(path: Path) -> ScanStream | None:
    """Stream of a scene of nuScenes or a log of Argoverse 2 at a path; None where there is none."""
    path = path.resolve()
    if any((data / "scene.json").is_file() or any(data.glob("v1.0-*/scene.json")) for data in (path, path.parent)):
        from modt.sources import nuscenes

        if (found := nuscenes.tables_of(path)) is not None:
            return nuscenes.open_scene(*found)
    if path.is_dir() and any((log / "sensors" / "lidar").is_dir() for log in (path, *list(path.parents)[:2])):
        from modt.sources import argoverse

        if (log := argoverse.log_of(path)) is not None:
            return argoverse.open_log(log)
    return None


def _stream(path: Path, period_s: float) -> ScanStream | None:
    """Stream in a folder or around it, by the most specific layout; None where there is none."""
    from modt.sources import kitti

    if not path.is_dir():
        return None
    for drive in (path, path.parent, path.parent.parent):
        scans = drive / "velodyne_points"
        if path in (drive, scans, scans / "data") and scans.is_dir():
            return kitti.raw_drive(drive)
    if _is_tracking(path):
        return kitti.tracking_sequence(path)
    if path.name == "velodyne" and (path.parent / "calib.txt").is_file() and _has_scans(path):
        path = path.parent
    if _has_scans(path / "velodyne"):
        return kitti.odometry_sequence(path)
    folders = (path, path / "scans") if (path / "truth.csv").is_file() else (path,)
    for folder, suffix in product(folders, SUFFIXES):
        if _has_scans(folder, suffix):
            return kitti.scan_folder(folder, period_s, suffix)
    return None


def _is_bag(path: Path) -> bool:
    """Whether a path is a recording: a file, or a folder of the files of one recording without scans."""
    if not path.is_dir():
        return path.is_file() and path.name.lower().endswith(BAGS)
    if not any(file.name.lower().endswith(BAGS) for file in path.iterdir()):
        return False
    from modt.sources.bag_files import METADATA, bag_in

    if (path / METADATA).is_file():
        return True
    return bool(bag_in(path)) and not any(_has_scans(path, suffix) for suffix in SUFFIXES)


def _is_tracking(path: Path) -> bool:
    return path.parent.name == "velodyne" and path.name.isdigit() and _has_scans(path)


def _has_scans(path: Path, suffix: str = ".bin") -> bool:
    return path.is_dir() and any(f.is_file() and not f.name.startswith(".") for f in path.glob(f"*{suffix}"))


def _nearby(path: Path) -> list[Path]:
    """Streams up to three levels below."""
    below = [p for depth in ("*", "*/*", "*/*/*") for p in sorted(path.glob(depth)) if p.is_dir()]
    odometry = {p for p in below if _has_scans(p / "velodyne") and not p.name.startswith("velodyne")}
    logs = {p for p in below if (p / "sensors" / "lidar").is_dir()}
    return [p for p in below if (p / "velodyne_points").is_dir() or _is_tracking(p) or p in odometry | logs]
