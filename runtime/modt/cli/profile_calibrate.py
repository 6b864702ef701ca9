"""`modt-profile calibrate`: fits what a board's work costs, and writes it to a profile."""

from __future__ import annotations

import argparse


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("calibrate", help="fit what this board's work costs")
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Not yet."""
    return 1
