"""Finds every meter there is, and picks one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.battery import find_batteries
from modt.energy.meters.candidate import Candidate
from modt.energy.meters.hwmon import find_hwmon
from modt.energy.meters.meter import Kind, Scope
from modt.energy.meters.model import ModelMeter
from modt.energy.meters.pmic import find_pmic
from modt.energy.meters.powercap import find_powercap
from modt.errors import MisuseError

KINDS = (Kind.MEASURED, Kind.INTEGRATED, Kind.ESTIMATED)
SCOPES = (Scope.CPU, Scope.SOC, Scope.BOARD, Scope.ROBOT, Scope.RAIL, Scope.PROCESS)
"""The narrower the scope, the larger this program's share of what it shows."""


@dataclass(frozen=True, slots=True)
class Discovery:
    """What this machine offers.

    Attributes:
        candidates: all, the best first, the unusable last with the reason.
    """

    candidates: tuple[Candidate, ...]

    @property
    def best(self) -> Candidate:
        """The first usable one; the model always is."""
        return next(c for c in self.candidates if c.usable)

    def choose(self, name: str | None) -> Candidate:
        """The best, or the one whose name holds the text.

        Raises:
            MisuseError: none does, or it is not usable.
        """
        if name is None:
            return self.best
        for candidate in self.candidates:
            if name.lower() in candidate.name.lower() and candidate.usable:
                return candidate
        unusable = next((c for c in self.candidates if name.lower() in c.name.lower()), None)
        if unusable is not None:
            raise MisuseError(f"meter {unusable.name}", unusable.why_not, unusable.remedy)
        names = ", ".join(c.name for c in self.candidates if c.usable)
        raise MisuseError(f"meter {name}", "not on this machine", f"use one of: {names}")


def discover(model: ModelMeter, sys: Path = Path("/sys"), vcgencmd: str = "vcgencmd") -> Discovery:
    """Look for every sort of meter; the model stands last among the usable."""
    found = [*find_powercap(sys), *find_hwmon(sys), *find_pmic(vcgencmd), *find_batteries(sys)]
    found.append(Candidate(model.facts.name, (model,)))
    return Discovery(tuple(sorted(found, key=_rank)))


def _rank(candidate: Candidate) -> tuple[int, int, int]:
    facts = candidate.facts
    if facts is None or not candidate.usable:
        return (1, 0 if facts else 1, 0)
    return (0, KINDS.index(facts.kind), SCOPES.index(facts.scope))
