"""`modt evaluate`: recorded runs against labels, and experiments on whole drives."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modt.cli.options import add_examples
from modt.cli.progress import bar
from modt.errors import MisuseError
from modt_commands import experiments
from modt_evaluation.rules import IGNORABLE

if TYPE_CHECKING:
    from modt_evaluation.evaluation import DriveRows, Evaluation
    from modt_evaluation.run_record import RunRecord
    from modt_evaluation.truth import Truth

DIGITS = 6


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("evaluate", help="judge recorded runs against labels")
    pairs = "run directories (of replay --labels) and their labels"
    p.add_argument("pairs", nargs="*", type=Path, metavar="RUN TRUTH", help=pairs)
    p.add_argument("--json", action="store_true", help="print JSON, modt.evaluation/1")
    p.add_argument("--html", type=Path, metavar="FILE", help="write an HTML page with plots as well (extra view)")
    vans = "count KITTI's vans as cars (all), or ignore them (paper)"
    p.add_argument("--classes", choices=("all", "paper"), default="all", help=vans)
    what = f"judge what is ignored: {', '.join(IGNORABLE)}; may be repeated"
    p.add_argument("--count", action="append", choices=IGNORABLE, default=[], metavar="WHAT", help=what)
    sector = "half the angle of the labelled sector [deg] (default: 40; 180 where labels are all round)"
    p.add_argument("--sector", type=float, metavar="DEG", help=sector)
    further = "table of objects that the labels of the one drive leave out (docs/evaluation.md)"
    p.add_argument("--further", type=Path, metavar="FILE", help=further)
    listed = "list tracks that move like road users and have no label, with pictures and a table for --further"
    p.add_argument("--unlabelled", type=Path, metavar="DIR", help=listed)
    experiments.add_options(p)
    add_examples(
        p,
        "modt evaluate RUN DRIVE                            a run against the labels of its drive",
        "modt evaluate RUN1 DRIVE1 RUN2 DRIVE2 --json       several together, as JSON",
        "modt evaluate RUN DRIVE --unlabelled DIR           what the labels may leave out",
        "modt evaluate --experiment all --kitti ROOT        the paper's tables and figures",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Evaluate and print, list what has no label, or make experiments.

    Raises:
        MisuseError: a run or its labels cannot be used, or do not belong together.
        ModtError: a file cannot be written.
    """
    if arguments.experiment:
        if arguments.unlabelled:
            raise MisuseError("--experiment", "makes runs of its own", "leave --unlabelled out")
        if arguments.pairs:
            raise MisuseError("--experiment", "takes no runs", "leave RUN TRUTH out, or --experiment")
        return experiments.run(arguments)
    paths: list[Path] = arguments.pairs
    if not paths or len(paths) % 2:
        raise MisuseError("RUN TRUTH", f"{len(paths)} paths are no pairs", "give each run followed by its labels")
    if arguments.sector is not None and not 0 < arguments.sector <= 180:
        raise MisuseError("--sector", f"{arguments.sector:g} is no half sector", "give more than 0 and at most 180")
    for option in ("further", "unlabelled"):
        if getattr(arguments, option) is not None and len(paths) > 2:
            raise MisuseError(f"--{option}", "is for one drive", "judge that drive alone")
    if arguments.unlabelled is None:
        judge_runs(arguments)
    elif arguments.json or arguments.html:
        raise MisuseError("--unlabelled", "makes a list, and no evaluation", "leave --json and --html out")
    else:
        list_unlabelled(arguments)
    return 0


def opened(arguments: argparse.Namespace, path: Path, labels: Path) -> tuple[RunRecord, Truth]:
    """A run and its labels, with further objects and the rules that are asked for.

    Raises:
        MisuseError: one of them cannot be used.
    """
    from dataclasses import replace

    from modt_evaluation.further_objects import with_further
    from modt_evaluation.run_record import RunRecord
    from modt_evaluation.truth import KITTI_TYPES, PAPER_TYPES
    from modt_evaluation.truth_files import open_truth

    paper = arguments.classes == "paper"
    record = RunRecord.open(path)
    truth = open_truth(labels, record.stream, paper=paper)
    if arguments.further is not None:
        truth = with_further(truth, arguments.further, PAPER_TYPES if paper else KITTI_TYPES)
    sector_deg = truth.rules.sector_deg if arguments.sector is None else arguments.sector
    ignored = truth.rules.ignored - set(arguments.count)
    return record, replace(truth, rules=replace(truth.rules, sector_deg=sector_deg, ignored=ignored))


def judge_runs(arguments: argparse.Namespace) -> None:
    """Print the evaluation of the runs by sensor and over all sensors; write its page where one is asked for.

    Raises:
        MisuseError: a run or its labels cannot be used, or do not belong together.
        ModtError: the page cannot be written.
    """
    from modt.sources.nuscenes import read_scene, tables_of
    from modt_evaluation.engine import Engine
    from modt_evaluation.evaluation import evaluation
    from modt_evaluation.export import Export
    from modt_evaluation.nuscenes_results import results_of, scores
    from modt_evaluation.report import report
    from modt_evaluation.run_record import RunRecord

    pairs = [*zip(arguments.pairs[::2], arguments.pairs[1::2], strict=True)]
    judged: dict[int, tuple[str, DriveRows]] = {}
    with (
        Engine(arguments.jobs, arguments.scheduler) as engine,
        bar(len(pairs), "run", shown=not arguments.quiet) as tick,
    ):
        for drive, rows_of_sensor in engine.results(partial(_judged, arguments, pairs), range(len(pairs))):
            judged[drive] = rows_of_sensor
            tick(str(pairs[drive][0]))
    by_sensor: dict[str, list[DriveRows]] = {}
    of_scenes = []
    for drive, (run, labels) in enumerate(pairs):
        sensor, rows = judged[drive]
        by_sensor.setdefault(sensor, []).append(rows)
        if (tables := tables_of(labels.resolve())) is not None:
            scene = read_scene(*tables)
            record = RunRecord.open(run)
            of_scenes.append((scene, results_of(scene, record.mount, Export(record).results())))
    sensors = {name: evaluation(drives) for name, drives in by_sensor.items()}
    if len(sensors) > 1:
        sensors["all sensors"] = evaluation([rows for drives in by_sensor.values() for rows in drives])
    benchmark = scores(of_scenes) if of_scenes else {}
    if arguments.html is not None:
        from modt_profiling.reporting.view_extra import save
        from modt_viewer.evaluation_page import evaluation_page

        save(arguments.html, evaluation_page(sensors))
    print(_json(sensors, benchmark) if arguments.json else report(sensors, benchmark))


def _json(sensors: Mapping[str, Evaluation], benchmark: Mapping[str, Any]) -> str:
    """The scores as JSON."""
    import json
    from dataclasses import asdict

    from modt_evaluation.evaluation import SCHEMA

    found = {"schema": SCHEMA, "sensors": {name: asdict(scores) for name, scores in sensors.items()}}
    if benchmark:
        found["nuscenes"] = {name: asdict(score) for name, score in benchmark.items()}
    text = json.dumps(found)
    return json.dumps(json.loads(text, parse_float=lambda number: round(float(number), DIGITS)), indent=1)


def _judged(arguments: argparse.Namespace, pairs: Sequence[tuple[Path, Path]], drive: int) -> tuple[str, DriveRows]:
    """Sensor and judged rows of a run and its labels."""
    from modt_evaluation.evaluation import collect

    record, truth = opened(arguments, *pairs[drive])
    return record.sensor, collect(record.frames(truth), truth.rules, drive)


def list_unlabelled(arguments: argparse.Namespace) -> None:
    """Print the tracks that move like road users and have no label; write their pictures and their table.

    Raises:
        MisuseError: the run or its labels cannot be used.
        ModtError: a file cannot be written.
    """
    from modt.sinks.output import writing
    from modt_evaluation.unlabelled import listing, unlabelled, write_table
    from modt_profiling.reporting.view_extra import save
    from modt_viewer.crop_picture import mover_page

    folder: Path = arguments.unlabelled
    record, truth = opened(arguments, *arguments.pairs)
    movers = unlabelled(record, truth)
    if not movers:
        print("every track that moves like a road user has a label")
        return
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    table = folder / "further.csv"
    write_table(table, movers)
    if truth.scans is not None:
        save(folder / "tracks.html", mover_page(movers, truth.scans))
    print("\n".join(listing(movers)))
    print(f"\npictures and rows in {folder}: keep the rows of real road users, then give --further {table}")
