"""`modt-profile report`: energy and savings of one run, while it runs or afterwards, or gamma over comparisons."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modt.cli import options

if TYPE_CHECKING:
    from modt.reporting.document import Document
    from modt.reporting.page import Plot


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    text = "report energy and savings of a run, which may still be running, or gamma over comparisons"
    p = commands.add_parser("report", help=text)
    paths = "directory written by modt replay, or JSON files of modt-profile compare"
    p.add_argument("paths", nargs="+", type=Path, metavar="RUN", help=paths)
    options.add_report_options(p)
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Report."""
    from modt.reporting.page import document_page, save
    from modt.reporting.quantity import to_json

    paths = arguments.paths
    tree, document, plots = _of_comparisons(paths) if len(paths) > 1 or paths[0].is_file() else _of_run(paths[0])
    if arguments.html is not None:
        save(arguments.html, document_page(document, plots))
    print(json.dumps(to_json(tree), indent=2, allow_nan=False) if arguments.json else document.text())
    return 0


def _of_run(run: Path) -> tuple[dict[str, Any], Document, list[Plot]]:
    import numpy as np

    from modt.reporting.run_report import lateness_plots, run_document, run_plots, run_tree
    from modt.sinks.records import records_of

    with records_of(run), np.errstate(over="raise", invalid="raise"):
        tree = run_tree(run)
        return tree, run_document(tree), [*run_plots(tree), *lateness_plots(run)]


def _of_comparisons(paths: list[Path]) -> tuple[dict[str, Any], Document, list[Plot]]:
    from modt_desk.comparison.regimes import regimes_tree
    from modt_desk.comparison.regimes_view import regimes_document, regimes_plots

    tree = regimes_tree(paths)
    return tree, regimes_document(tree), regimes_plots(tree)
