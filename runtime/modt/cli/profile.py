"""`modt-profile`: what it costs, what it saves, and how anybody can know."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from modt import __version__
from modt.cli import profile_calibrate, profile_compare, profile_meters, profile_report
from modt.cli.main import guarded

COMMANDS = (profile_meters, profile_calibrate, profile_report, profile_compare)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(prog="modt-profile", description="Accounts for the energy of modt.")
    top.add_argument("--version", action="version", version=f"modt {__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(commands)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status: 0 well, 1 failed, 2 misused."""
    arguments = parser().parse_args(argv)
    return guarded(lambda: int(arguments.run(arguments)))


if __name__ == "__main__":
    sys.exit(main())
