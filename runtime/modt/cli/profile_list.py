"""`modt profiles`: list the shipped profiles, one line each."""

from __future__ import annotations

import argparse

from modt import assets
from modt.cli import options


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command."""
    p = commands.add_parser("profiles", help="list the shipped profiles of sensors and boards")
    options.add_examples(p, "modt profiles   names for --profile; modt profile show NAME prints one")
    p.set_defaults(run=run)


def run(_arguments: argparse.Namespace) -> int:
    """Print the first sentence of the comment at the head of each profile."""
    for path in sorted(assets.folder("profiles").glob("*.yaml")):
        about = path.read_text(encoding="utf-8").partition("\n# ")[2].partition("\n")[0]
        print(f"{path.stem:<16}{about.partition('. ')[0].rstrip('.')}")
    return 0
