"""A result of discovery, usable or not."""

from __future__ import annotations

from dataclasses import dataclass

from modt.energy.meters.meter import Facts, Meter, MeterLostError


@dataclass(frozen=True, slots=True)
class Candidate:
    """Meters whose readings may be summed, since their scopes do not overlap.

    Attributes:
        name: for display.
        meters: one per socket or rail; empty where none of this type exists.
        why_not: reason against its use, empty where there is none.
        remedy: action that makes it usable.
    """

    name: str
    meters: tuple[Meter, ...] = ()
    why_not: str = ""
    remedy: str = ""

    @property
    def usable(self) -> bool:
        """Whether it can be read."""
        return bool(self.meters) and not self.why_not

    @property
    def facts(self) -> Facts | None:
        """Facts of the first meter; those of one candidate are alike."""
        return self.meters[0].facts if self.meters else None


def probe(name: str, meters: tuple[Meter, ...], remedy: str) -> Candidate:
    """A candidate, read once to find out whether it can be."""
    try:
        for meter in meters:
            meter.read()
    except MeterLostError as error:
        return Candidate(name, meters, str(error), remedy)
    return Candidate(name, meters)
