"""`modt profile`: commands on profiles, and `modt profiles`: a list of the shipped ones."""

from __future__ import annotations

import argparse
from typing import Any

import yaml

from modt import assets, profile
from modt.cli import options
from modt.cli.command import show_help
from modt_commands import profile_fit, profile_schema


def add_parser(commands: options.Commands) -> None:
    """Declare the group with its commands, and the list."""
    what = "profiles of sensors and boards"
    beside = "For the energy of runs see `modt-profile`."
    p = commands.add_parser("profile", help=what, description=f"Write and show {what}.", epilog=beside)
    p.set_defaults(run=lambda _: show_help(p))
    group = p.add_subparsers(dest="profile_command", metavar="COMMAND")
    profile_fit.add_parser(group)
    q = group.add_parser("show", help="print the configuration of profiles, and which of them has set each key")
    which = f"name or file; later ones win key by key (default: {profile.DEFAULT})"
    q.add_argument("names", nargs="*", metavar="NAME|FILE", help=which)
    options.add_examples(
        q,
        "modt profile show vlp-16 raspberry-pi-5   a sensor and a board together",
        "modt profile show my-robot.yaml           a file",
    )
    q.set_defaults(run=run_show)
    profile_schema.add_parser(group)
    q = commands.add_parser("profiles", help="list the shipped profiles of sensors and boards")
    options.add_examples(q, "modt profiles   names for --profile; modt profile show NAME prints one")
    q.set_defaults(run=run_list)


def run_list(_arguments: argparse.Namespace) -> int:
    """Print the first sentence of the comment at the head of each profile."""
    for path in sorted(assets.folder("profiles").glob("*.yaml")):
        about = path.read_text(encoding="utf-8").partition("\n# ")[2].partition("\n")[0]
        print(f"{path.stem:<16}{about.partition('. ')[0].rstrip('.')}")
    return 0


def run_show(arguments: argparse.Namespace) -> int:
    """Print the configuration."""
    print(shown(profile.resolve(arguments.names)), end="")
    return 0


def shown(found: profile.Resolved) -> str:
    """The configuration as YAML, itself a profile. A comment on each value names the profile that has set it."""
    assumed = () if found.sensor else profile.resolve(profile.DEFAULT).layers
    text = ""
    layers = (*reversed(found.layers), *reversed(assumed))
    for stage, values in profile.dump(found.config).items():
        text += f"{stage}:\n"
        for key, value in values.items():
            set_by = next((layer.name for layer in layers if key in layer.settings.get(stage, ())), "default")
            text += f"  {key}: {value_text(value)} # {set_by}\n"
    near_m = found.config.sensor.person_seen_from_m
    return text if near_m is None else f"{text}# half of a person's height is in view from {near_m:.1f} m on\n"


def value_text(value: Any) -> str:
    """A value on one line of YAML."""
    plain = list(value) if isinstance(value, tuple) else value
    text: str = yaml.safe_dump(plain, default_flow_style=True, allow_unicode=True, width=float("inf"))
    return text.removesuffix("\n").removesuffix("\n...")
