"""Sensors of the kernel's hwmon: INA power monitors on a board's rails, and AMD's energy counters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.candidate import Candidate, tried
from modt.energy.meters.meter import Facts, Kind, MeterLostError, Quantity, Scope, known, read_number, read_text

INA = ("ina219", "ina220", "ina226", "ina230", "ina231", "ina238", "ina3221")
INPUT_RAILS = ("VDD_IN", "POM_5V_IN", "VIN_SYS_5V0", "VIN", "5V_IN")
"""Rails that feed everything else on boards known to be so wired."""


@dataclass(frozen=True, slots=True)
class InaRail:
    """One channel of an INA chip: its power where the chip computes it, voltage times current elsewhere."""

    path: Path
    channel: int
    label: str

    @property
    def facts(self) -> Facts:
        """Declared by the driver; a step of a milliampere at the rail's voltage is the resolution."""
        computed = (self.path / f"power{self.channel}_input").exists()
        return Facts(
            name=f"hwmon {known(self.path / 'name')} {self.label}",
            quantity=Quantity.POWER,
            unit="uW" if computed else "mV x mA",
            resolution=5e-3,
            update_s=0.01,
            wrap_J=None,
            max_W=500.0,
            scope=_scope(self.label),
            kind=Kind.INTEGRATED,
            privilege="none",
        )

    def read(self) -> float:
        """The power now [W]."""
        power = self.path / f"power{self.channel}_input"
        if power.exists():
            return 1e-6 * read_number(power)
        volts = 1e-3 * read_number(self.path / f"in{self.channel}_input")
        return volts * 1e-3 * read_number(self.path / f"curr{self.channel}_input")


@dataclass(frozen=True, slots=True)
class AmdSocket:
    """Energy of one AMD socket; the driver widens the counter to 64 bits."""

    path: Path
    channel: int

    @property
    def facts(self) -> Facts:
        """Declared by the driver."""
        return Facts(
            name=f"hwmon amd_energy socket {self.channel}",
            quantity=Quantity.ENERGY,
            unit="uJ",
            resolution=15.3e-6,
            update_s=1e-3,
            wrap_J=None,
            max_W=1000.0,
            scope=Scope.CPU,
            kind=Kind.MEASURED,
            privilege="root",
        )

    def read(self) -> float:
        """The counter [J]."""
        return 1e-6 * read_number(self.path / f"energy{self.channel}_input")


def find_hwmon(sys: Path) -> list[Candidate]:
    """AMD sockets, then every rail: rails may feed one another, so none are added up."""
    folders = sorted((sys / "class" / "hwmon").glob("hwmon*"), key=lambda p: (len(p.name), p.name))
    sockets: list[AmdSocket] = []
    rails: list[InaRail] = []
    for folder in folders:
        chip = known(folder / "name")
        if chip == "amd_energy":
            sockets += [AmdSocket(folder, n) for n in _channels(folder, "energy") if _is_socket(folder, n)]
        elif chip in INA:
            rails += _rails(folder)
    found = []
    if sockets:
        found.append(tried("AMD sockets", tuple(sockets), "run as root, or chmod a+r its energy inputs"))
    found += [tried(rail.facts.name, (rail,), "make the chip's inputs readable") for rail in rails]
    if not found:
        remedy = "wire an INA219, INA226 or INA3221 into the supply and load its driver"
        found.append(Candidate("hwmon", (), "no power monitor and no energy counter under /sys/class/hwmon", remedy))
    return found


def _channels(folder: Path, quantity: str) -> list[int]:
    names = (p.name for p in folder.glob(f"{quantity}[0-9]*_input"))
    return sorted(int(name[len(quantity) : -len("_input")]) for name in names)


def _is_socket(folder: Path, channel: int) -> bool:
    return (known(folder / f"energy{channel}_label") or "").startswith("Esocket")


def _rails(folder: Path) -> list[InaRail]:
    """Channels that measure a current; the sum channel of an INA3221 is no rail."""
    rails = []
    for channel in _channels(folder, "curr"):
        label = known(folder / f"in{channel}_label") or f"{folder.name} channel {channel}"
        if _off(folder, channel) or not (folder / f"in{channel}_input").exists() or label.startswith("sum"):
            continue
        rails.append(InaRail(folder, channel, label))
    return rails


def _scope(label: str) -> Scope:
    if label in INPUT_RAILS:
        return Scope.BOARD
    return Scope.SOC if "CPU" in label else Scope.RAIL


def _off(folder: Path, channel: int) -> bool:
    try:
        return read_text(folder / f"in{channel}_enable") == "0"
    except MeterLostError:
        return False
