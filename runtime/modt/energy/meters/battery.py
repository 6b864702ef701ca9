"""Batteries of the kernel's power_supply class."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.candidate import Candidate, probe
from modt.energy.meters.meter import (
    Facts,
    FileMeter,
    Kind,
    Measurand,
    MeterLostError,
    Scope,
    read_text,
    text_or_none,
)


@dataclass(frozen=True, slots=True)
class Battery(FileMeter):
    """Power drawn from a battery while it discharges; its scope is the whole robot."""

    def read(self) -> float:
        """Present power [W].

        Raises:
            MeterLostError: unreadable, or not discharging.
        """
        folder = self.paths[0].parent
        status = read_text(folder / "status")
        if status != "Discharging":
            raise MeterLostError(f"{folder.name} is {status.lower() or 'of unknown status'}, not discharging")
        return abs(FileMeter.read(self))


def find_batteries(sys: Path) -> list[Candidate]:
    """Every battery of the machine itself; those of peripherals (scope Device) are left out."""
    supplies = sorted((sys / "class" / "power_supply").glob("*"))
    own = [p for p in supplies if text_or_none(p / "type") == "Battery" and text_or_none(p / "scope") != "Device"]
    if not own:
        return [
            Candidate("battery", (), "none under /sys/class/power_supply", "run from a battery with a fuel gauge")
        ]
    return [probe(f"battery {p.name}", (_battery(p),), "unplug the charger") for p in own]


def _battery(folder: Path) -> Battery:
    power = folder / "power_now"
    computed = power.exists()
    facts = Facts(
        name=f"battery {folder.name}",
        measurand=Measurand.POWER,
        unit="uW" if computed else "uV x uA",
        resolution=0.01,
        max_W=2000.0,
        scope=Scope.ROBOT,
        kind=Kind.INTEGRATED,
    )
    if computed:
        return Battery(facts, (power,), 1e-6)
    return Battery(facts, (folder / "voltage_now", folder / "current_now"), 1e-12)
