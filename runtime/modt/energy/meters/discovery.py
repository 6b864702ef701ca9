"""Discovery of the meters of a machine, and the choice of one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.meter import Candidate, Kind, Meter, Scope
from modt.energy.meters.pmic import find_pmic
from modt.energy.meters.sysfs import find_batteries, find_hwmon, find_powercap
from modt.errors import MisuseError

FINDERS = (find_powercap, find_hwmon, find_batteries)
"""Searches of a mount point of sysfs; each returns the candidates of one type of meter."""
_KINDS = (Kind.MEASURED, Kind.INTEGRATED, Kind.ESTIMATED)
_SCOPES = (Scope.CPU, Scope.SOC, Scope.BOARD, Scope.ROBOT, Scope.RAIL, Scope.PROCESS)
"""Order of preference: the narrower the scope, the larger the share of this program."""


@dataclass(frozen=True, slots=True)
class Discovery:
    """The meters of a machine: usable ones first, the best before all; then the others, with the reason."""

    candidates: tuple[Candidate, ...]

    @property
    def best(self) -> Candidate:
        """The first usable one; the model always is."""
        return next(c for c in self.candidates if c.usable)

    def choose(self, name: str | None) -> Candidate:
        """The best, or the first usable one whose name contains the text.

        Raises:
            MisuseError: none does, or it is not usable.
        """
        if name is None:
            return self.best
        named = [c for c in self.candidates if name.lower() in c.name.lower()]  # usable ones come first
        if named and named[0].usable:
            return named[0]
        if named:
            raise MisuseError(f"meter {named[0].name}", named[0].why_not, named[0].remedy)
        names = ", ".join(c.name for c in self.candidates if c.usable)
        raise MisuseError(f"meter {name}", "not on this machine", f"use one of: {names}")


def discover(model: Meter, sys: Path = Path("/sys"), vcgencmd: str = "vcgencmd") -> Discovery:
    """Search every type of meter; the model is the last of the usable ones."""
    found = [candidate for find in FINDERS for candidate in find(sys)]
    found += [*find_pmic(vcgencmd), Candidate(model.facts.name, (model,))]
    return Discovery(tuple(sorted(found, key=_rank)))


def _rank(candidate: Candidate) -> tuple[int, int, int]:
    facts = candidate.facts
    if facts is None or not candidate.usable:
        return (1, 0 if facts else 1, 0)
    return (0, _KINDS.index(facts.kind), _SCOPES.index(facts.scope))
