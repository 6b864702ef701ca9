"""`modt evaluate --experiment`: the paper's experiments on a user's drives."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from modt import host
from modt.cli import options
from modt.cli.progress import bar
from modt.errors import MisuseError

if TYPE_CHECKING:  # NumPy is imported once the process is pinned
    from modt_evaluation.experiments.drives import Drive
    from modt_evaluation.experiments.study import Row, Study


def add_options(p: argparse.ArgumentParser) -> None:
    """Options of the experiments, and those that the evaluation of runs shares with them."""
    g = p.add_argument_group("experiments", "the paper's tables and figures on KITTI and simulated drives")
    which = "experiments by name, or all (docs/evaluation.md)"
    g.add_argument("--experiment", nargs="+", action="extend", metavar="NAME", help=which)
    g.add_argument("--kitti", type=Path, metavar="ROOT", help="folder below which labelled KITTI drives lie")
    count = options.bounded(int, 0, 10_000, "drives")
    g.add_argument("--simulated", type=count, default=0, metavar="N", help="number of simulated drives")
    seconds = options.bounded(float, 0.2, 3600, "seconds")
    each = "duration of each simulated drive [s] (default: %(default)g)"
    g.add_argument("--seconds", type=seconds, default=6.0, metavar="S", help=each)
    options.add(g, "profile", help="profile on top of that of each drive's sensor; later ones win key by key")
    beside = "compare with the same experiments under this further profile; repeatable"
    g.add_argument("--beside", action="append", default=[], metavar="NAME|FILE", help=beside)
    out = "directory of the results (default: %(default)s)"
    g.add_argument("--out", type=Path, default=Path("results"), metavar="DIR", help=out)
    jobs = options.bounded(int, 1, 1024, "processes")
    p.add_argument("--jobs", type=jobs, default=1, metavar="N", help="number of processes (default: %(default)s)")
    p.add_argument("--scheduler", metavar="ADDRESS", help="run on the workers of this Dask scheduler (extra batch)")
    p.add_argument("--quiet", action="store_true", help="no progress")


def run(arguments: argparse.Namespace) -> int:
    """Make the experiments and write their results.

    Raises:
        MisuseError: no such experiment, or no drive.
    """
    host.pin_to_core(None)  # one thread a process: NumPy is imported from here on
    from modt_evaluation.engine import Engine
    from modt_evaluation.experiments.catalogue import chosen
    from modt_evaluation.experiments.study import Study

    base = tuple(arguments.profile)
    profiles = [base, *((*base, name) for name in arguments.beside)]
    study = Study(chosen(arguments.experiment), _drives(arguments), profiles)
    with (
        Engine(arguments.jobs, arguments.scheduler) as engine,
        bar(len(study.tasks()), "replay", shown=not arguments.quiet) as tick,
    ):
        rows = study.rows(engine, tick)
    if not rows:
        raise MisuseError(
            "--experiment", "none of the drives has the sweeps that it needs", "add them, or --simulated N"
        )
    written = _write_results(arguments, study, rows)
    print(f"{len(rows)} figures: {', '.join(map(str, written))}")
    return 0


def _drives(arguments: argparse.Namespace) -> list[Drive]:
    """The drives that the command line asks for."""
    from modt_evaluation.experiments.drives import completed, kitti_drives, simulated_drives

    recorded = [] if arguments.kitti is None else kitti_drives(arguments.kitti)
    drives: list[Drive] = [*recorded]
    if arguments.further is not None:
        drives.append(completed(recorded, arguments.further))
    drives += simulated_drives(arguments.simulated, arguments.seconds)
    if not drives:
        raise MisuseError("--experiment", "no drives", "give --kitti ROOT, --simulated N or both")
    return drives


def _write_results(arguments: argparse.Namespace, study: Study, rows: Sequence[Row]) -> list[Path]:
    """Write table, text and page of the results; the page alone needs an extra. Returns the files written."""
    from modt.sinks.output import writing
    from modt_evaluation.experiments.markdown import markdown, sources
    from modt_evaluation.experiments.results_page import results_page
    from modt_profiling.reporting.view_extra import save

    out: Path = arguments.out
    made_of = (_command(arguments), sources(study.profiles), study.experiments, rows)
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        _write_table(out / "results.csv", rows)
        (out / "results.md").write_text(markdown(*made_of), encoding="utf-8")
    written = [out / "results.md", out / "results.csv"]
    try:
        save(out / "results.html", results_page(*made_of))
        written.insert(0, out / "results.html")
    except MisuseError as error:
        print(f"modt: no page: {error}", file=sys.stderr)
    return written


def _write_table(path: Path, rows: Sequence[Row]) -> None:
    import csv
    from dataclasses import asdict

    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(asdict(rows[0])), lineterminator="\n")
        table.writeheader()
        table.writerows(map(asdict, rows))


def _command(arguments: argparse.Namespace) -> str:
    """The command, as another user would write it."""
    words = ["modt", "evaluate", "--experiment", *arguments.experiment]
    words += ["--kitti", "ROOT"] if arguments.kitti else []
    words += ["--simulated", str(arguments.simulated)] if arguments.simulated else []
    words += ["--seconds", f"{arguments.seconds:g}"] if arguments.simulated else []
    words += [word for name in arguments.profile for word in ("--profile", name)]
    words += [word for name in arguments.beside for word in ("--beside", name)]
    words += ["--further", arguments.further.name] if arguments.further else []
    return shlex.join(words)
