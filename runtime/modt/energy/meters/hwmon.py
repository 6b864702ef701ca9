"""Sensors of the kernel's hwmon class: INA power monitors on a board's rails, and AMD's energy counters."""

from __future__ import annotations

from pathlib import Path

from modt.energy.meters.meter import Candidate, Facts, Kind, Meter, Scope, file_meter, probe, text_or_none

_INA_CHIPS = ("ina219", "ina220", "ina226", "ina230", "ina231", "ina238", "ina3221")
_INPUT_RAILS = ("VDD_IN", "POM_5V_IN", "VIN_SYS_5V0", "VIN", "5V_IN")
"""Rails that feed all others on boards known to be wired so."""


def find_hwmon(sys: Path) -> list[Candidate]:
    """AMD sockets, then every rail: rails may feed one another, so none are summed."""
    folders = sorted((sys / "class" / "hwmon").glob("hwmon*"), key=lambda p: (len(p.name), p.name))
    sockets: list[Meter] = []
    rails: list[Meter] = []
    for folder in folders:
        chip = text_or_none(folder / "name")
        if chip == "amd_energy":
            sockets += _sockets(folder)
        elif chip in _INA_CHIPS:
            rails += _rails(folder, chip)
    found = [probe(rail.facts.name, (rail,), "make the chip's inputs readable") for rail in rails]
    if sockets:
        found.insert(0, probe("AMD sockets", tuple(sockets), "run as root, or chmod a+r its energy inputs"))
    if not found:
        remedy = "wire an INA219, INA226 or INA3221 into the supply and load its driver"
        found.append(Candidate("hwmon", (), "no power monitor and no energy counter under /sys/class/hwmon", remedy))
    return found


def _channels(folder: Path, prefix: str) -> list[int]:
    names = (p.name for p in folder.glob(f"{prefix}[0-9]*_input"))
    return sorted(int(name[len(prefix) : -len("_input")]) for name in names)


def _sockets(folder: Path) -> list[Meter]:
    """Energy counters of the sockets, without those of the cores; the driver widens them to 64 bits."""
    sockets = []
    for n in _channels(folder, "energy"):
        if (text_or_none(folder / f"energy{n}_label") or "").startswith("Esocket"):
            facts = Facts(
                name=f"hwmon amd_energy socket {n}",
                unit="uJ",
                resolution=15.3e-6,
                max_W=1000.0,
                scope=Scope.CPU,
                kind=Kind.MEASURED,
                privilege="root",
            )
            sockets.append(file_meter(facts, folder / f"energy{n}_input"))
    return sockets


def _rails(folder: Path, chip: str) -> list[Meter]:
    """Enabled channels with a current, by their own power where the chip computes it, else by voltage x current.

    The sum channel of an INA3221 is not a rail.
    """
    rails = []
    for n in _channels(folder, "curr"):
        voltage, current, power = (folder / f"{prefix}{n}_input" for prefix in ("in", "curr", "power"))
        label = text_or_none(folder / f"in{n}_label") or f"{folder.name} channel {n}"
        if text_or_none(folder / f"in{n}_enable") == "0" or not voltage.exists() or label.startswith("sum"):
            continue
        computed = power.exists()
        facts = Facts(
            name=f"hwmon {chip} {label}",
            unit="uW" if computed else "mV x mA",
            resolution=5e-3,  # 1 mA at 5 V
            max_W=500.0,
            scope=Scope.BOARD if label in _INPUT_RAILS else Scope.SOC if "CPU" in label else Scope.RAIL,
            kind=Kind.INTEGRATED,
        )
        rails.append(file_meter(facts, *((power,) if computed else (voltage, current))))
    return rails
