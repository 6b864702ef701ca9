"""`modt profile`: commands on profiles, and `modt profiles`: a list of the shipped ones."""

from __future__ import annotations

import argparse
from importlib import import_module

from modt import assets
from modt.cli import options
from modt.cli.command import show_help

COMMANDS = {
    "fit": "modt_desk.cli.profile_fit",
    "show": "modt.cli.profile_show",
    "schema": "modt_desk.cli.profile_schema",
}
"""Module of each command of the group."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the group with its commands, and the list."""
    what, beside = "profiles of sensors and boards", "For the energy of runs see `modt-profile`."
    p = commands.add_parser("profile", help=what, description=f"Write and show {what}.", epilog=beside)
    p.set_defaults(run=lambda _: show_help(p))
    group = p.add_subparsers(dest="profile_command", metavar="COMMAND")
    for module in COMMANDS.values():
        import_module(module).add_parser(group)
    q = commands.add_parser("profiles", help="list the shipped profiles of sensors and boards")
    options.add_examples(q, "modt profiles   names for --profile; modt profile show NAME prints one")
    q.set_defaults(run=run_list)


def run_list(_arguments: argparse.Namespace) -> int:
    """Print the first sentence of the comment at the head of each profile."""
    for path in sorted(assets.folder("profiles").glob("*.yaml")):
        about = path.read_text(encoding="utf-8").partition("\n# ")[2].partition("\n")[0]
        print(f"{path.stem:<16}{about.partition('. ')[0].rstrip('.')}")
    return 0
