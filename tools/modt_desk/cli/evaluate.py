"""`modt evaluate`: recorded runs against labels, and experiments on whole drives."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.cli.options import add_examples
from modt.errors import MisuseError
from modt_desk.cli import experiments
from modt_desk.evaluation.rules import IGNORABLE

DIGITS = 6


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("evaluate", help="judge recorded runs against labels")
    pairs = "run directories (of replay --labels) and their labels"
    p.add_argument("pairs", nargs="*", type=Path, metavar="RUN TRUTH", help=pairs)
    p.add_argument("--json", action="store_true", help="write JSON, modt.evaluation/1")
    p.add_argument("--html", type=Path, metavar="FILE", help="write an HTML page with plots, too")
    vans = "KITTI's vans as cars (all), or ignored (paper)"
    p.add_argument("--classes", choices=("all", "paper"), default="all", help=vans)
    what = f"judge what is ignored: {', '.join(IGNORABLE)}; may be repeated"
    p.add_argument("--count", action="append", choices=IGNORABLE, default=[], metavar="WHAT", help=what)
    sector = "half the labelled sector (default: 40; 180 where labels are all round)"
    p.add_argument("--sector", type=float, metavar="DEG", help=sector)
    further = "table of objects that the labels of the one drive leave out (docs/evaluation.md)"
    p.add_argument("--further", type=Path, metavar="FILE", help=further)
    experiments.add_options(p)
    add_examples(
        p,
        "modt evaluate RUN DRIVE                            a run against the labels of its drive",
        "modt evaluate RUN1 DRIVE1 RUN2 DRIVE2 --json       several together, as JSON",
        "modt evaluate --experiment all --kitti ROOT        the paper's tables and figures",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Evaluate and print, or make experiments.

    Raises:
        MisuseError: a run or its labels cannot be used, or do not belong together.
    """
    if arguments.experiment:
        if arguments.pairs:
            raise MisuseError("--experiment", "takes no runs", "leave RUN TRUTH out, or --experiment")
        return experiments.run(arguments)
    import json
    from dataclasses import asdict, replace

    from modt_desk.evaluation.evaluation import SCHEMA, DriveRows, collect, evaluation
    from modt_desk.evaluation.further_objects import with_further
    from modt_desk.evaluation.report import report
    from modt_desk.evaluation.run_record import RunRecord
    from modt_desk.evaluation.truth import KITTI_TYPES, PAPER_TYPES
    from modt_desk.evaluation.truth_files import open_truth

    paths: list[Path] = arguments.pairs
    if not paths or len(paths) % 2:
        raise MisuseError("RUN TRUTH", f"{len(paths)} paths are no pairs", "give each run followed by its labels")
    if arguments.sector is not None and not 0 < arguments.sector <= 180:
        raise MisuseError("--sector", f"{arguments.sector:g} is no half sector", "give more than 0 and at most 180")
    if arguments.further is not None and len(paths) > 2:
        raise MisuseError("--further", "is the table of one drive", "judge that drive alone")
    paper = arguments.classes == "paper"
    by_sensor: dict[str, list[DriveRows]] = {}
    for drive, (path, labels) in enumerate(zip(paths[::2], paths[1::2], strict=True)):
        record = RunRecord.open(path)
        truth = open_truth(labels, record.stream, paper=paper)
        if arguments.further is not None:
            truth = with_further(truth, arguments.further, PAPER_TYPES if paper else KITTI_TYPES)
        sector_deg = truth.rules.sector_deg if arguments.sector is None else arguments.sector
        ignored = truth.rules.ignored - set(arguments.count)
        rules = replace(truth.rules, sector_deg=sector_deg, ignored=ignored)
        by_sensor.setdefault(record.sensor, []).append(collect(record.frames(truth), rules, drive))
    sensors = {name: evaluation(found) for name, found in by_sensor.items()}
    if len(sensors) > 1:
        sensors["all sensors"] = evaluation([rows for found in by_sensor.values() for rows in found])
    if arguments.html is not None:
        from modt_desk.reporting.page import save
        from modt_desk.viewer.evaluation_page import evaluation_page

        save(arguments.html, evaluation_page(sensors))
    if arguments.json:
        text = json.dumps({"schema": SCHEMA, "sensors": {name: asdict(found) for name, found in sensors.items()}})
        print(json.dumps(json.loads(text, parse_float=lambda number: round(float(number), DIGITS)), indent=1))
    else:
        print(report(sensors))
    return 0
