"""`modt-profile meters`: every meter there is, which one is used, and why not the others."""

from __future__ import annotations

import argparse
import json
from typing import Any

from modt import profile
from modt.cli import metering
from modt.energy.meters.candidate import Candidate
from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Kind, MeterLostError, Quantity

SCHEMA = "modt.meters/1"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("meters", help="list the energy meters of this machine")
    p.add_argument("--profile", default=profile.DEFAULT, metavar="NAME|FILE", help="board whose model stands in")
    p.add_argument("--json", action="store_true", help="as JSON")
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print them."""
    found = metering.meters(profile.load(arguments.profile).energy)
    print(json.dumps(_tree(found), indent=2) if arguments.json else text(found))
    return 0


def text(found: Discovery) -> str:
    """The usable, the best first; then the others with what stands against them."""
    lines = []
    for candidate in found.candidates:
        if candidate.usable:
            facts = candidate.facts
            assert facts is not None
            used = "used" if candidate is found.best else "    "
            wrap = f", starts again after {facts.wrap_J:.0f} J" if facts.wrap_J else ""
            step = "J" if facts.quantity is Quantity.ENERGY else "W"
            lines += [
                f"{used}  {candidate.name}: {facts.kind.value}, now {_now(candidate)}",
                f"      covers {facts.scope.value}; {facts.quantity.value} in {facts.unit}, steps of "
                f"{facts.resolution:g} {step}{wrap}; privilege: {facts.privilege}",
            ]
    for candidate in found.candidates:
        if not candidate.usable:
            lines += [f"  no  {candidate.name}: {candidate.why_not}", f"      to use it: {candidate.remedy}"]
    return "\n".join(lines)


def _now(candidate: Candidate) -> str:
    try:
        value = sum(meter.read() for meter in candidate.meters)
    except MeterLostError as error:
        return f"{Kind.UNAVAILABLE.value} ({error})"
    facts = candidate.facts
    return f"{value:.3f} {'W' if facts and facts.quantity is Quantity.POWER else 'J'}"


def _tree(found: Discovery) -> dict[str, Any]:
    def one(candidate: Candidate) -> dict[str, Any]:
        facts = candidate.facts
        return {
            "name": candidate.name,
            "usable": candidate.usable,
            "used": candidate is found.best,
            "why_not": candidate.why_not or None,
            "remedy": candidate.remedy or None,
            "kind": facts.kind.value if facts and candidate.usable else Kind.UNAVAILABLE.value,
            "scope": facts.scope.value if facts else None,
            "quantity": facts.quantity.value if facts else None,
            "resolution": facts.resolution if facts else None,
            "wrap_J": facts.wrap_J if facts else None,
            "privilege": facts.privilege if facts else None,
        }

    return {"schema": SCHEMA, "meters": [one(c) for c in found.candidates]}
