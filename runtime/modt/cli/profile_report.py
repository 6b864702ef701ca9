"""`modt-profile report`: what a run cost and saved, while it runs or afterwards."""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("report", help="say what a run cost and saved; it may still be running")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory that modt replay writes")
    p.add_argument("--json", action="store_true", help="as JSON")
    p.add_argument("--html", type=Path, metavar="FILE", help="a page with plots")
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Read, and print."""
    from modt.reporting.page import save
    from modt.reporting.quantity import plain
    from modt.reporting.run_page import run_page
    from modt.reporting.run_report import run_tree
    from modt.reporting.run_text import run_text

    tree = run_tree(arguments.run_directory)
    if arguments.html is not None:
        save(arguments.html, run_page(tree))
    print(json.dumps(plain(tree), indent=2, allow_nan=False) if arguments.json else run_text(tree))
    return 0
