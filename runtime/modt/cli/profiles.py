"""`modt profile`: commands on profiles."""

from __future__ import annotations

import argparse
from importlib import import_module

COMMANDS = {
    "fit": "modt_desk.cli.profile_fit",
    "show": "modt.cli.profile_show",
    "schema": "modt_desk.cli.profile_schema",
}
"""Module of each command."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the group and its commands."""
    p = commands.add_parser("profile", help="profiles of sensors and boards")
    group = p.add_subparsers(dest="profile_command", required=True, metavar="COMMAND")
    for module in COMMANDS.values():
        import_module(module).add_parser(group)
