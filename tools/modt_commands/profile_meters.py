"""`modt-profile meters`: list the meters of this machine, and why others cannot be used."""

from __future__ import annotations

import argparse
import json
from typing import Any

from modt import profile
from modt.cli import options
from modt.energy.meters.discovery import Discovery, discover
from modt.energy.meters.meter import Candidate, Kind, MeterLostError

SCHEMA = "modt.meters/1"


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("meters", help="list the energy meters of this machine")
    options.add(p, "profile", help=f"board (default: {profile.DEFAULT})")
    options.add(p, "json")
    options.add_examples(
        p,
        "modt-profile meters                            meters, and why others cannot be read",
        "modt-profile meters --profile raspberry-pi-5   with the power model of that board",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """List the meters."""
    found = discover(profile.load(arguments.profile).energy)
    tree = {"schema": SCHEMA, "meters": [_entry(c, used=c is found.best) for c in found.candidates]}
    print(json.dumps(tree, indent=2) if arguments.json else text(found))
    return 0


def text(found: Discovery) -> str:
    """List of the usable meters, the best first, then of the others with reason and remedy."""
    lines = []
    for candidate in found.candidates:
        facts = candidate.facts
        if facts is None or not candidate.usable:
            lines += [f"  no  {candidate.name}: {candidate.why_not}", f"      to use it: {candidate.remedy}"]
            continue
        used = "used" if candidate is found.best else "    "
        unit, quantity = ("J", "energy") if facts.counts else ("W", "power")
        try:
            reading = f"{sum(meter.read() for meter in candidate.meters):.3f} {unit}"
        except MeterLostError as error:
            reading = f"{Kind.UNAVAILABLE} ({error})"
        wrap = f", wraps after {facts.wrap_J:.0f} J" if facts.wrap_J else ""
        lines += [
            f"{used}  {candidate.name}: {facts.kind}, now {reading}",
            f"      covers {facts.scope}; {quantity} in {facts.unit}, steps of "
            f"{facts.resolution:g} {unit}{wrap}; privilege: {facts.privilege}",
        ]
    return "\n".join(lines)


def _entry(candidate: Candidate, *, used: bool) -> dict[str, Any]:
    facts = candidate.facts
    return {
        "name": candidate.name,
        "usable": candidate.usable,
        "used": used,
        "why_not": candidate.why_not or None,
        "remedy": candidate.remedy or None,
        "kind": facts.kind if facts and candidate.usable else Kind.UNAVAILABLE,
        "scope": facts and facts.scope,
        "quantity": facts and ("energy" if facts.counts else "power"),
        "resolution": facts and facts.resolution,
        "wrap_J": facts and facts.wrap_J,
        "privilege": facts and facts.privilege,
    }
