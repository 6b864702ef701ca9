"""Batches of simulated recordings: two workers against one, a worker that is killed, and a batch that is stopped.

    python -m tools.bench.batch FOLDER [--recordings 40] [--seconds 8] [--seed 0] [--write]

Every dataset is compared with that of one process without a cluster: the tracks byte for byte, the other tables but
for what is measured. The seed draws the worker that is killed and when, and when the batch is stopped. --write puts
the table into docs/batch.md. FOLDER keeps the recordings and the datasets. With 40 recordings it takes three minutes
of both cores, and two more to make the recordings. Another load of the machine falsifies the ratio.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pyarrow import parquet

from modt import host
from modt_batch.dataset import Dataset
from modt_batch.recording import MEASURED
from modt_evaluation.engine import Engine
from modt_evaluation.experiments.markdown import commit
from modt_simulation.kitti_raw import DATE, DriveWriter
from modt_simulation.synthetic_stream import CAMERA, SyntheticStream
from tools.docs.sections import DOCS, update
from tools.options import parser

PAGE = DOCS / "batch.md"
MARK = "tools.bench.batch"
SENSOR = "vlp-16"
SCENES = ("street", "crossing")
FIRST_SEED = 9000
"""Seed of the first recording."""
MOMENTS = (0.25, 0.75)
"""Part of an undisturbed batch within which a worker is killed, or the batch is stopped."""


@dataclass(frozen=True)
class Recording:
    """A simulated drive to be written into a folder."""

    folder: Path
    number: int
    seconds: float


def simulate(recording: Recording) -> Path:
    """Write the drive, unless it is there; returns its folder."""
    out = recording.folder / f"{recording.number:03}"
    done = [*out.glob(f"{DATE}/*_sync")]
    if not done:
        stream = SyntheticStream(
            SCENES[recording.number % len(SCENES)], SENSOR, recording.seconds, FIRST_SEED + recording.number
        )
        partial = out.with_suffix(".part")
        shutil.rmtree(partial, ignore_errors=True)
        writer = DriveWriter(partial, CAMERA, all_around=True)
        for frame, truth in stream.sweeps():
            writer.write(frame, truth)
        writer.close()
        partial.rename(out)
        done = [*out.glob(f"{DATE}/*_sync")]
    return done[0]


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """Dask cluster on loopback of processes with one thread each."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0") as started:
        yield started


def begin(recordings: list[Path], out: Path, *where: str) -> subprocess.Popen[bytes]:
    """Start a batch."""
    words = [*map(str, recordings), "--profile", SENSOR, "--out", str(out), "--pages", "0", "--quiet", *where]
    return subprocess.Popen([sys.executable, "-m", "modt", "batch", *words])


def seconds_of(batch: subprocess.Popen[bytes]) -> float:
    """Wait for a batch that has begun; returns the time [s].

    Raises:
        SystemExit: it failed.
    """
    began_s = time.perf_counter()
    if batch.wait():
        raise SystemExit("the batch failed")
    return time.perf_counter() - began_s


def contents(dataset: Path) -> dict[str, object]:
    """Tracks by their bytes, and the other tables without what is measured, by file."""
    found: dict[str, object] = {path.name: path.read_bytes() for path in (dataset / "tracks").iterdir()}
    for table, measured in MEASURED.items():
        for path in (dataset / table).iterdir():
            found[f"{table}/{path.name}"] = parquet.read_table(path).drop_columns(list(measured)).to_pydict()
    return found


class Bench:
    """The batches on one set of recordings, each into a new dataset of a folder."""

    def __init__(self, recordings: list[Path], folder: Path, rng: np.random.Generator) -> None:
        self.recordings = recordings
        self.folder = folder
        self.rng = rng
        self.expected: dict[str, object] = {}

    def dataset(self, name: str) -> Path:
        """Path of a dataset, which is not there."""
        path = self.folder / name
        shutil.rmtree(path, ignore_errors=True)
        return path

    def same(self, dataset: Path) -> str:
        """Whether a dataset is that of one process, in words."""
        return "yes" if contents(dataset) == self.expected else "**no**"

    def alone(self) -> float:
        """One process without a cluster; returns the time [s]."""
        out = self.dataset("alone")
        took_s = seconds_of(begin(self.recordings, out, "--jobs", "1"))
        self.expected = contents(out)
        return took_s

    def on_workers(self, workers: int) -> tuple[float, str]:
        """Time [s] on so many workers, and whether the dataset is the same."""
        out = self.dataset(f"workers-{workers}")
        with cluster(workers) as started:
            took_s = seconds_of(begin(self.recordings, out, "--scheduler", started.scheduler_address))
        return took_s, self.same(out)

    def killed(self, undisturbed_s: float) -> tuple[float, str]:
        """The same on two workers, one of which is killed."""
        out = self.dataset("killed")
        with cluster(2) as started:
            batch = begin(self.recordings, out, "--scheduler", started.scheduler_address)
            began_s = time.perf_counter()
            time.sleep(self.rng.uniform(*MOMENTS) * undisturbed_s)
            os.kill(started.workers[int(self.rng.integers(2))].pid, signal.SIGKILL)
            seconds_of(batch)
            took_s = time.perf_counter() - began_s
        return took_s, self.same(out)

    def stopped(self, undisturbed_s: float) -> tuple[int, int, str]:
        """Stop a batch on two workers and resume it.

        Returns:
            runs before it is stopped, those of them that are done again, and whether the dataset is the same.
        """
        out = self.dataset("stopped")
        with cluster(2) as started:
            batch = begin(self.recordings, out, "--scheduler", started.scheduler_address)
            time.sleep(self.rng.uniform(*MOMENTS) * undisturbed_s)
            batch.send_signal(signal.SIGINT)
            batch.wait()
        before = _written(out)
        seconds_of(begin(self.recordings, out, "--jobs", "2"))
        after = _written(out)
        anew = sum(after[name] != moment for name, moment in before.items())
        return len(before), anew, self.same(out)


def _written(out: Path) -> dict[str, int]:
    """Time at which each committed run of a dataset was written [ns]."""
    runs = out / "runs"
    return {name: (runs / f"{name}.parquet").stat().st_mtime_ns for name in Dataset(str(out)).committed()}


def table(bench: Bench) -> Iterator[str]:
    """The batches and what became of them, as Markdown."""
    alone_s = bench.alone()
    one_s, one = bench.on_workers(1)
    two_s, two = bench.on_workers(2)
    killed_s, killed = bench.killed(two_s)
    before, anew, stopped = bench.stopped(two_s)
    frames = sum(row["frames"] for row in Dataset(str(bench.folder / "alone")).runs())
    made = f"{len(bench.recordings)} recordings with {frames} frames of a {SENSOR}"
    yield f"Commit {commit()}, {host.description()['cpu']}, {made}; made by `python -m {MARK}`."
    yield ""
    yield "| batch | time | same dataset |"
    yield "|---|---|---|"
    yield f"| one process, no cluster | {alone_s:.1f} s | - |"
    yield f"| one worker | {one_s:.1f} s | {one} |"
    yield f"| two workers | {two_s:.1f} s, {one_s / two_s:.2f} times as fast as one | {two} |"
    yield f"| two workers, one killed | {killed_s:.1f} s | {killed} |"
    yield f"| stopped after {before} runs, and resumed: {anew} of them done again | - | {stopped} |"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("folder", type=Path, metavar="FOLDER")
    options.add_argument("--recordings", type=int, default=40, metavar="N")
    options.add_argument("--seconds", type=float, default=8.0, metavar="S")
    options.add_argument("--seed", type=int, default=0, metavar="N")
    options.add_argument("--write", action="store_true")
    args = options.parse_args()
    host.pin_to_core(None)
    wanted = [Recording(args.folder / "recordings", number, args.seconds) for number in range(args.recordings)]
    with Engine(2) as engine:
        recordings = sorted(path for _, path in engine.results(simulate, wanted))
    made = "\n".join(table(Bench(recordings, args.folder, np.random.default_rng(args.seed))))
    print(made)
    if args.write:
        update(PAGE, MARK, made)


if __name__ == "__main__":
    main()
