"""`modt-profile regimes`: gamma over several comparisons."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from modt.cli import options


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("regimes", help="report gamma over several comparisons, and what sets it")
    comparisons = "JSON files of modt-profile compare"
    p.add_argument("comparisons", nargs="+", type=Path, metavar="COMPARISON", help=comparisons)
    options.add_report_options(p)
    options.add_examples(
        p,
        "modt-profile regimes a.json b.json              gamma of several comparisons",
        "modt-profile regimes *.json --html gamma.html   the same as a page",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Report."""
    from modt_desk.comparison.regimes import regimes_tree
    from modt_desk.comparison.regimes_view import regimes_document, regimes_plots
    from modt_desk.reporting.page import document_page, save
    from modt_desk.reporting.quantity import to_json

    tree = regimes_tree(arguments.comparisons)
    document = regimes_document(tree)
    if arguments.html is not None:
        save(arguments.html, document_page(document, regimes_plots(tree)))
    print(json.dumps(to_json(tree), indent=2, allow_nan=False) if arguments.json else document.text())
    return 0
