"""`modt-profile report`: energy and savings of one run, while it runs or afterwards."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt.cli import options


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("report", help="report energy and savings of a run; it may still be running")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory written by modt replay")
    options.add_report_options(p)
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Report."""
    import numpy as np

    from modt.reporting.lateness_plot import lateness_plots
    from modt.reporting.page import document_page, save
    from modt.reporting.quantity import to_json
    from modt.reporting.run_report import run_tree
    from modt.reporting.run_view import run_document, run_plots
    from modt.sinks.records import records_of

    with records_of(arguments.run_directory), np.errstate(over="raise", invalid="raise"):
        tree = run_tree(arguments.run_directory)
        document = run_document(tree)
        text = json.dumps(to_json(tree), indent=2, allow_nan=False) if arguments.json else document.text()
        page = None
        if arguments.html is not None:
            page = document_page(document, [*run_plots(tree), *lateness_plots(arguments.run_directory)])
    if page is not None:
        save(arguments.html, page)
    print(text)
    return 0
