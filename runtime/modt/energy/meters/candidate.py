"""What discovery found, usable or not."""

from __future__ import annotations

from dataclasses import dataclass

from modt.energy.meters.meter import Facts, Meter, MeterLostError


@dataclass(frozen=True, slots=True)
class Candidate:
    """Meters that may be added up, because none of them counts what another one counts.

    Attributes:
        name: for people.
        meters: one a socket or rail; empty where there is none of this sort.
        why_not: what stands against using it, empty where nothing does.
        remedy: what would make it usable.
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
        """Of the first meter; all of one candidate are alike."""
        return self.meters[0].facts if self.meters else None


def tried(name: str, meters: tuple[Meter, ...], remedy: str) -> Candidate:
    """A candidate that has been read once, so that it is known whether it can be."""
    try:
        for meter in meters:
            meter.read()
    except MeterLostError as error:
        return Candidate(name, meters, str(error), remedy)
    return Candidate(name, meters)
