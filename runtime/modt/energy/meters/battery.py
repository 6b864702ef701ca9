"""Batteries, as the kernel's power_supply class shows them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.candidate import Candidate, tried
from modt.energy.meters.meter import Facts, Kind, MeterLostError, Quantity, Scope, known, read_number, read_text


@dataclass(frozen=True, slots=True)
class Battery:
    """Power drawn from a battery while it discharges; it covers the whole robot."""

    path: Path

    @property
    def facts(self) -> Facts:
        """Declared by the class; fuel gauges average over seconds."""
        computed = (self.path / "power_now").exists()
        return Facts(
            name=f"battery {self.path.name}",
            quantity=Quantity.POWER,
            unit="uW" if computed else "uV x uA",
            resolution=0.01,
            update_s=5.0,
            wrap_J=None,
            max_W=2000.0,
            scope=Scope.ROBOT,
            kind=Kind.INTEGRATED,
            privilege="none",
        )

    def read(self) -> float:
        """The power now [W].

        Raises:
            MeterLostError: unreadable, or not discharging.
        """
        status = read_text(self.path / "status")
        if status != "Discharging":
            raise MeterLostError(f"{self.path.name} is {status.lower() or 'of unknown status'}, not discharging")
        power = self.path / "power_now"
        if power.exists():
            return abs(1e-6 * read_number(power))
        volts = 1e-6 * read_number(self.path / "voltage_now")
        return abs(volts * 1e-6 * read_number(self.path / "current_now"))


def find_batteries(sys: Path) -> list[Candidate]:
    """Every battery of the machine itself; those of mice and pens have scope Device and are left out."""
    supplies = sorted((sys / "class" / "power_supply").glob("*"))
    own = [p for p in supplies if known(p / "type") == "Battery" and known(p / "scope") != "Device"]
    if not own:
        return [
            Candidate("battery", (), "none under /sys/class/power_supply", "run from a battery with a fuel gauge")
        ]
    return [tried(f"battery {p.name}", (Battery(p),), "unplug the charger") for p in own]
