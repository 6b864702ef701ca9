"""`modt profile show`: print the configuration of profiles, with the profile that has set each key."""

from __future__ import annotations

import argparse

from modt import profile
from modt.cli import options


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("show", help="print the configuration of profiles, and which of them has set each key")
    which = f"name or file; later ones win key by key (default: {profile.DEFAULT})"
    p.add_argument("names", nargs="*", metavar="NAME|FILE", help=which)
    options.add_examples(
        p,
        "modt profile show vlp-16 raspberry-pi-5   a sensor and a board together",
        "modt profile show my-robot.yaml           a file",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the configuration."""
    print(profile.resolve(arguments.names).shown(), end="")
    return 0
