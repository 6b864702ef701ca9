"""`modt profile`: commands on profiles."""

from __future__ import annotations

import argparse
from importlib import import_module

from modt.cli.command import show_help

COMMANDS = {
    "fit": "modt_desk.cli.profile_fit",
    "show": "modt.cli.profile_show",
    "schema": "modt_desk.cli.profile_schema",
}
"""Module of each command."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the group and its commands."""
    what, beside = "profiles of sensors and boards", "For the energy of runs see `modt-profile`."
    p = commands.add_parser("profile", help=what, description=f"Write and show {what}.", epilog=beside)
    p.set_defaults(run=lambda _: show_help(p))
    group = p.add_subparsers(dest="profile_command", metavar="COMMAND")
    for module in COMMANDS.values():
        import_module(module).add_parser(group)
