"""Synthetic drives on disk, and runs on them."""

from pathlib import Path

from modt.cli.main import main
from modt_simulation.kitti_raw import DriveWriter
from modt_simulation.synthetic_stream import CAMERA, SyntheticStream

DAY = "2020_01_01/2020_01_01_drive_0000_sync"


def drive_and_run(
    root: Path, sensor: str = "vlp-16", seconds: float = 0.5, options: tuple[str, ...] = (), name: str = ""
) -> tuple[Path, Path]:
    """A run with labels of points on a simulated drive of its own, and the drive."""
    folder, run = root / f"drive-{name or sensor}", root / f"run-{name or sensor}"
    simulate = ("simulate", "--sensor", sensor, "--seconds", seconds, "--seed", 5, *options, "--out", folder)
    replay = ("replay", folder / DAY, "--profile", sensor, "--labels", "--quiet", "--core", "none", "--out", run)
    for command in (simulate, replay):
        assert main([str(word) for word in command]) == 0
    return run, folder / DAY


def written(root: Path, stream: SyntheticStream) -> DriveWriter:
    """The writer of a stream as a drive in KITTI's layout."""
    writer = DriveWriter(root, CAMERA)
    for frame, truth in stream.sweeps():
        writer.write(frame, truth)
    writer.close()
    return writer


def scans(folder: Path, stream: SyntheticStream) -> Path:
    """A folder with the scans of a stream and nothing else."""
    folder.mkdir(parents=True, exist_ok=True)
    for frame in stream:
        frame.points.tofile(folder / f"{frame.index:06d}.bin")
    return folder
