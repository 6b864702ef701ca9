"""`modt-profile report`: energy and savings of a run, while it runs or afterwards."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt.cli import options
from modt.errors import MisuseError


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("report", help="report energy and savings of a run, which may still be running")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory written by modt replay or modt run")
    options.add(p, "json", "html")
    options.add_examples(
        p,
        "modt-profile report RUN                      what a run has cost",
        "modt-profile report RUN --html report.html   the same as a page with plots",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Report.

    Raises:
        MisuseError: it is no run.
    """
    import numpy as np

    from modt.sinks.records import records_of
    from modt_profiling.reporting.quantity import to_json
    from modt_profiling.reporting.run_report import lateness_plots, run_document, run_plots, run_tree
    from modt_profiling.reporting.view_extra import save

    path = arguments.run_directory
    if path.is_file():
        raise MisuseError(path, "is a file", "give the directory of a run")
    with records_of(path), np.errstate(over="raise", invalid="raise"):
        tree = run_tree(path)
        document = run_document(tree)
        page = document.page([*run_plots(tree), *lateness_plots(path)])
    if arguments.html is not None:
        save(arguments.html, page)
    print(json.dumps(to_json(tree), indent=2, allow_nan=False) if arguments.json else document.text())
    return 0
