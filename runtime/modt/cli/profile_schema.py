"""`modt profile schema`: the JSON Schema of a profile."""

from __future__ import annotations

import argparse

from modt.profile.schema import schema_text


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command."""
    p = commands.add_parser("schema", help="print the JSON Schema of a profile, for editors")
    p.set_defaults(run=run)


def run(_arguments: argparse.Namespace) -> int:
    """Print it."""
    print(schema_text(), end="")
    return 0
