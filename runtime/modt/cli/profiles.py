"""`modt profile`: commands on profiles."""

from __future__ import annotations

import argparse

from modt.cli import profile_fit, profile_schema, profile_show

COMMANDS = (profile_fit, profile_show, profile_schema)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the group and its commands."""
    p = commands.add_parser("profile", help="profiles of sensors and boards")
    group = p.add_subparsers(dest="profile_command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(group)
