"""`modt batch`: many recordings on many cores or machines, into one dataset with one report."""

from __future__ import annotations

import argparse
import fnmatch
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modt import host
from modt.cli import options
from modt.cli.progress import bar
from modt.errors import MisuseError, install

if TYPE_CHECKING:
    from modt_batch.dataset import Dataset
    from modt_batch.recording import Task
    from modt_evaluation.engine import Engine

SCHEMA = "modt.batch/1"
PAGES = 10


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("batch", help="replay many recordings into one Parquet dataset with a report")
    each = "paths as for modt replay, or addresses of fsspec, such as s3://BUCKET/DRIVES/*"
    p.add_argument("recordings", nargs="+", metavar="RECORDING", help=each)
    options.add(p, "capture")
    options.add_frames_option(p)
    options.add(p, "profile", "fov")
    modes = f"one or several of {', '.join(options.MODES)}, with commas (default: accurate)"
    p.add_argument("--mode", type=modes_of, dest="modes", default=("accurate",), metavar="MODE,...", help=modes)
    out = "folder or address of the dataset; the same command goes on where it was stopped"
    p.add_argument("--out", required=True, metavar="DATASET", help=out)
    jobs = options.bounded(int, 1, 1024, "processes")
    p.add_argument("--jobs", type=jobs, metavar="N", help="number of processes of this machine (default: its cores)")
    cluster = "run on the workers of this Dask scheduler, which have modt and reach the recordings and the dataset"
    p.add_argument("--scheduler", metavar="ADDRESS", help=cluster)
    pages = options.bounded(int, 0, 1000, "a count")
    worst = "number of the worst runs that get a page, by another replay of each (default: %(default)s)"
    p.add_argument("--pages", type=pages, default=PAGES, metavar="N", help=worst)
    p.add_argument("--quiet", action="store_true", help="no progress, no report on the terminal")
    options.add_examples(
        p,
        "modt batch DRIVES/* --profile vlp-16 --out results               on all cores",
        "modt batch DRIVES/* --mode conventional,accurate --out results   both modes, and what one saves",
        "modt batch s3://IN/* --scheduler tcp://HOST:8786 --out s3://OUT  on a Dask cluster",
    )
    p.set_defaults(run=run)


def modes_of(text: str) -> tuple[str, ...]:
    """Parse modes with commas between them."""
    modes = tuple(dict.fromkeys(text.split(",")))
    if unknown := set(modes) - set(options.MODES):
        raise argparse.ArgumentTypeError(f"no mode {', '.join(sorted(unknown))}; known: {', '.join(options.MODES)}")
    return modes


def run(arguments: argparse.Namespace) -> int:
    """Run what is missing in the dataset, and write the report; returns 0, or 1 if a run failed.

    Raises:
        MisuseError: a recording is missing, the dataset was made by another request, or an extra is not installed.
        ModtError: the dataset cannot be written, or the scheduler cannot be reached.
    """
    host.pin_to_core(None)  # one thread a process: NumPy is imported from here on
    try:
        from modt_batch.dataset import Dataset
        from modt_batch.recording import Task
    except ModuleNotFoundError as error:
        raise MisuseError("modt batch", f"needs {error.name}", install("batch")) from None
    from modt.app.inputs import Request
    from modt_evaluation.engine import Engine

    dataset = Dataset(_absolute(arguments.out))
    addresses = _recordings(arguments.recordings, local=arguments.scheduler is None)
    names = [_absolute(name) if Path(name).is_file() else name for name in arguments.profile]
    request = Request(capture=arguments.capture, profile=names, fov=arguments.fov, frames=arguments.frames)
    dataset.describe(_description(request))
    tasks = [
        Task(address, _in_mode(request, mode), dataset.address) for mode in arguments.modes for address in addresses
    ]
    jobs = arguments.jobs or len(os.sched_getaffinity(0))
    with Engine(jobs, arguments.scheduler, _say) as engine:
        failures = _run_missing(engine, dataset, tasks, quiet=arguments.quiet)
        _report(engine, dataset, tasks, failures, arguments)
    for name, reason in failures:
        _say(f"failed: {name}: {reason}")
    return int(bool(failures))


def _say(words: str) -> None:
    print(f"modt: {words}", file=sys.stderr)


def _absolute(place: str) -> str:
    """An address of fsspec as it is, a path made absolute."""
    return place if "://" in place or "::" in place else str(Path(place).resolve())


def _recordings(places: Sequence[str], *, local: bool) -> list[str]:
    """Addresses of the recordings, each once. A remote address with * stands for all that it matches, as does a
    data set of nuScenes for its scenes.

    Raises:
        MisuseError: a path is missing, or nothing matches an address.
    """
    import fsspec

    found: list[str] = []
    for place in places:
        address = _absolute(place)
        if "*" in address and "://" in address:
            files, path = fsspec.core.url_to_fs(address)
            matches = sorted(files.glob(path))
            found += [files.unstrip_protocol(match) for match in matches]
            if not matches:
                raise MisuseError(place, "matches nothing", "give the address of recordings")
        elif "://" in address or "::" in address:
            found.append(address)
        elif scenes := _scenes(Path(address)):
            found += scenes
        elif local and not Path(address).exists():
            raise MisuseError(place, "does not exist", "give the path of a recording")
        else:
            found.append(address)
    return list(dict.fromkeys(found))


def _scenes(path: Path) -> list[str]:
    """Paths of the scenes of nuScenes at DATA, or at DATA/PATTERN, which no folder need have; [] without its tables.

    Raises:
        MisuseError: no scene matches, or the tables cannot be read.
    """
    from modt.sources.nuscenes import read_table, tables_of

    if (found := tables_of(path)) is None:
        return []
    tables, pattern = found
    names = sorted(row["name"] for row in read_table(tables, "scene", "name"))
    matches = fnmatch.filter(names, pattern or "*")
    if not matches:
        raise MisuseError(path, f"no scene {pattern}", f"give one of {', '.join(names[:10])}")
    return [str((path.parent if pattern else path) / name) for name in matches]


def _in_mode(request: Any, mode: str) -> Any:
    from dataclasses import replace

    return replace(request, mode=mode)


def _description(request: Any) -> dict[str, Any]:
    """Settings that all runs of a dataset have in common."""
    from modt import __version__, profile

    return {
        "schema": SCHEMA,
        "version": __version__,
        "profile": [Path(name).name for name in request.profile],
        "settings": profile.dump(profile.load(request.profile)),
        "fov": request.fov,
        "frames": list(request.frames),
        "capture": [list(pair) for pair in request.capture],
    }


def _run_missing(engine: Engine, dataset: Dataset, tasks: Sequence[Task], *, quiet: bool) -> list[tuple[str, str]]:
    """Run the tasks that are not committed; returns the names of those that failed, with the reason."""
    from modt_batch.recording import process

    committed = dataset.committed()
    missing = [task for task in tasks if task.name not in committed]
    if not quiet and len(missing) < len(tasks):
        _say(f"{len(tasks) - len(missing)} of {len(tasks)} runs are there already")
    failures = []
    with bar(len(missing), "run", shown=not quiet) as step:
        for task, outcome in engine.outcomes(process, missing):
            if isinstance(outcome, Exception):
                failures.append((task.name, str(outcome) or type(outcome).__name__))
            step(task.name)
    return failures


def _report(
    engine: Engine,
    dataset: Dataset,
    tasks: Sequence[Task],
    failures: Sequence[tuple[str, str]],
    arguments: argparse.Namespace,
) -> None:
    """Write the pages of the worst runs and the report over all runs of the dataset, and print it."""
    from modt_batch.recording import write_page
    from modt_batch.report import document, worst_first
    from modt_profiling.reporting.html_page import html

    dataset.remove_unfinished()
    runs = dataset.runs()
    if not runs:
        return
    task_of = {task.name: task for task in tasks}
    worst = worst_first([row for row in runs if row["run"] in task_of])[: arguments.pages]
    wanted = [task_of[row["run"]] for row in worst]
    for task, outcome in engine.outcomes(write_page, [task for task in wanted if not dataset.has(task.page)]):
        if isinstance(outcome, Exception):
            _say(f"no page of {task.name}: {outcome}")
    found = document(runs, failures, worst)
    dataset.put("report.html", html(found.page(())).encode())
    if not arguments.quiet:
        print(found.text())
        print(f"\n{dataset.address}: tables tracks, ledger and runs; report.html")
