"""One task of a batch: replay a recording in a mode, and commit the tables of the run."""

from __future__ import annotations

import gc
import hashlib
import json
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fsspec
import numpy as np
import pyarrow
from fsspec.implementations.local import LocalFileSystem
from pyarrow import parquet

from modt import __version__, host, profile
from modt.app.build import replay
from modt.app.inputs import Request
from modt.app.systemd import notifier_of
from modt.energy.attribution import attribute
from modt.pipeline import STAGES
from modt.sinks.run_directory import LEDGER, SUMMARY
from modt_batch.dataset import PAGES, RUNS, Dataset
from modt_evaluation.export import Export, write_parquet
from modt_evaluation.run_record import RunRecord
from modt_profiling.energy.run_energy import modelled
from modt_profiling.reporting.records import read_ledger

MEASURED = {
    "ledger": ("wall_ns", "cpu_ns", "energy_J"),
    RUNS: ("cpu", "elapsed_s", "cpu_ms", "cpu_ms_p99", "pipeline_mJ", "energy_J", "peak_rss_mb"),
}
"""Columns of each table that differ between two runs of the same recording. All others are the same bytes."""
BESIDE_BYTES = 1 << 20
"""Greatest size of a file beside a recording that is copied with it, as a calibration [bytes]."""


@dataclass(frozen=True)
class Task:
    """A recording to be replayed in a mode.

    Attributes:
        address: path of the recording, or its address of fsspec.
        request: how it is replayed; its path is that of the copy of a remote recording.
        dataset: address of the dataset.
    """

    address: str
    request: Request
    dataset: str

    @property
    def recording(self) -> str:
        """Name of the recording in the dataset: that of its file or folder, and a hash of its address."""
        name = re.sub(r"[^\w.]+", "-", self.address.rstrip("/").rpartition("/")[2]) or "recording"
        return f"{name}-{hashlib.sha256(self.address.encode()).hexdigest()[:8]}"

    @property
    def name(self) -> str:
        """Name of the run in the dataset."""
        return f"{self.recording}-{self.request.mode}"

    @property
    def page(self) -> str:
        """Place of the page of the run in the dataset."""
        return f"{PAGES}/{self.name}.html"


def process(task: Task) -> str:
    """Replay the recording and commit the run, unless it is committed already; returns the name of the run.

    Raises:
        ModtError: the recording cannot be replayed, or the dataset cannot be written.
    """
    dataset = Dataset(task.dataset)
    if task.name not in dataset.committed():
        with logged(task.name, logging.WARNING), replayed(task) as run:
            names = {"run": task.name, "recording": task.recording, "mode": task.request.mode}
            files = {table: run / f"{table}.parquet" for table in ("tracks", "ledger", RUNS)}
            write_parquet(Export(RunRecord.open(run)), files["tracks"], names)
            ledger = _ledger(run)
            parquet.write_table(_table(names, ledger), files["ledger"])
            parquet.write_table(_table(names, [_run_row(task, run, ledger)]), files[RUNS])
            dataset.commit(task.name, files)
    return task.name


def write_page(task: Task) -> None:
    """Replay the recording once more and write the page that plays the run.

    Raises:
        ModtError: the recording cannot be replayed, or the dataset cannot be written.
        MisuseError: the extra view is not installed.
    """
    from modt_viewer.view import save_view

    with logged(task.name, logging.ERROR), replayed(task) as run:  # the first replay has logged the warnings
        save_view(run, None, None, task.request.capture, run / "view.html")
        Dataset(task.dataset).put(task.page, (run / "view.html").read_bytes())


@contextmanager
def logged(name: str, level: int) -> Iterator[None]:
    """Context in which lines of the log from a level on begin with a name."""
    handler = logging.StreamHandler()
    handler.setLevel(level)
    handler.setFormatter(logging.Formatter(f"modt: {name}: %(message)s"))
    root = logging.getLogger()
    before = root.handlers[:]
    root.handlers[:] = [handler]
    try:
        yield
    finally:
        root.handlers[:] = before


@contextmanager
def replayed(task: Task) -> Iterator[Path]:
    """Directory of a run of the task, which is deleted at the end of the context.

    Raises:
        ModtError: the recording cannot be replayed.
        KeyboardInterrupt: a signal ended the replay.
    """
    with TemporaryDirectory(prefix="modt-", dir=_scratch()) as scratch:
        request = replace(task.request, path=_local(task.address, Path(scratch) / "source"))
        run = Path(scratch) / "run"
        loop = replay(request, {}, run, None, ["modt", "batch"])
        loop.run(notifier_of({}))
        gc.unfreeze()  # the loop freezes what it finds, and this process replays more recordings
        if loop.stop.signal:
            raise KeyboardInterrupt
        yield run


def _scratch() -> str | None:
    """Folder for temporary files: that of the Dask worker, which is removed with it; None for the usual one."""
    try:
        from distributed import get_worker

        return str(get_worker().local_directory)
    except (ModuleNotFoundError, ValueError):
        return None


def _local(address: str, copy: Path) -> Path:
    """Path of a recording. A remote one is copied, with the small files beside it that hold calibrations."""
    files, path = fsspec.core.url_to_fs(address)
    if isinstance(files, LocalFileSystem):
        return Path(path)
    source = str(path).rstrip("/")
    parent, _, name = source.rpartition("/")
    copy.mkdir()
    found = files.find(source)  # the names of files are copied one by one, as `get` would take brackets for a pattern
    files.get(found, [str(copy / name) + file.removeprefix(source) for file in found])
    for entry in files.ls(parent, detail=True) if parent else ():
        beside = entry["name"].rpartition("/")[2]
        if entry["type"] == "file" and beside != name and entry["size"] <= BESIDE_BYTES:
            files.get_file(entry["name"], str(copy / beside))
    return copy / name


def _ledger(run: Path) -> list[dict[str, Any]]:
    """Rows of the work, the time and the energy of each stage in each frame. The energy is that of the power model.

    A meter of a machine reads all of its workers, so it is not used.
    """
    board = profile.parse(profile.to_yaml(RunRecord.open(run).facts["profile"]), run).energy
    rows = []
    for line in read_ledger(run / LEDGER):
        parts_J = attribute(modelled(line, board), board)
        for stage, work in line.stages.items():
            row = {"frame": line.frame, "stage": stage, "calls": work.calls, "items": work.items}
            times = {"points": work.points, "wall_ns": work.wall_ns, "cpu_ns": work.cpu_ns}
            rows.append(row | times | {"energy_J": parts_J.get(stage, 0.0)})
    return rows


def _run_row(task: Task, run: Path, ledger: list[dict[str, Any]]) -> dict[str, Any]:
    """Facts and figures of a run. What is measured stands at the end."""
    summary = json.loads((run / SUMMARY).read_text(encoding="utf-8"))
    ran = summary["run"]
    read = summary["read"]
    objects = summary["foreground_tracks"]
    of_frame: dict[int, float] = {}
    pipeline = [row for row in ledger if row["stage"] in STAGES]
    for row in pipeline:
        of_frame[row["frame"]] = of_frame.get(row["frame"], 0.0) + 1e-6 * row["cpu_ns"]
    cpu_ms = [*of_frame.values()]
    frames = summary["frames"]
    return {
        "address": task.address,
        "stream": ran["stream"],
        "profile": ran["profile"],
        "version": __version__,
        "frames": frames,
        "left_out": sum(read["left_out"].values()),
        **{f"frames_{level}": number for level, number in summary["trust"]["frames"].items()},
        "mean_speed_mps": read["mean_speed_mps"],
        "proposals": summary["proposals"],
        "classifications": summary["classifications"],
        "beta": summary["beta"],
        "tracks": summary["tracks"]["count"],
        "N_go": summary["tracks"]["N_go"],
        "objects": objects["count"],
        "N_go_objects": objects["N_go"],
        "cpu": host.description()["cpu"],
        "elapsed_s": ran["elapsed_s"],
        "cpu_ms": float(np.mean(cpu_ms)) if cpu_ms else None,
        "cpu_ms_p99": float(np.percentile(cpu_ms, 99)) if cpu_ms else None,
        "pipeline_mJ": 1e3 * sum(row["energy_J"] for row in pipeline) / frames if frames else None,
        "energy_J": sum(row["energy_J"] for row in ledger),
        "peak_rss_mb": summary["host"]["peak_rss_mb"],
    }


COLUMN_KINDS = {
    **dict.fromkeys(
        ("run", "recording", "mode", "stage", "address", "stream", "profile", "version", "cpu"), "string"
    ),
    **dict.fromkeys(("frame", "calls", "items", "points", "wall_ns", "cpu_ns"), "int64"),
    **dict.fromkeys(("frames", "left_out", "frames_good", "frames_degraded", "frames_blind"), "int64"),
    **dict.fromkeys(("proposals", "classifications", "tracks", "objects"), "int64"),
}
"""Types of the columns of ledger and runs; the others are numbers of 64 bits."""


def _table(names: dict[str, str], rows: list[dict[str, Any]]) -> Any:
    """Arrow table of rows, with columns of names in front."""
    columns = [*names, *rows[0]]
    kinds = [(name, pyarrow.type_for_alias(COLUMN_KINDS.get(name, "float64"))) for name in columns]
    return pyarrow.Table.from_pylist([names | row for row in rows], pyarrow.schema(kinds))
