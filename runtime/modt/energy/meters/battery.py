"""Batteries of the kernel's power_supply class."""

from __future__ import annotations

from pathlib import Path

from modt.energy.meters.meter import (
    Candidate,
    Facts,
    Kind,
    Meter,
    MeterLostError,
    Scope,
    file_meter,
    probe,
    read_text,
    text_or_none,
)


def find_batteries(sys: Path) -> list[Candidate]:
    """Every battery of the machine itself; those of peripherals (scope Device) are left out."""
    supplies = sorted((sys / "class" / "power_supply").glob("*"))
    own = [p for p in supplies if text_or_none(p / "type") == "Battery" and text_or_none(p / "scope") != "Device"]
    if not own:
        remedy = "run from a battery with a fuel gauge"
        return [Candidate("battery", (), "none under /sys/class/power_supply", remedy)]
    return [probe(f"battery {p.name}", (_battery(p),), "unplug the charger") for p in own]


def _battery(folder: Path) -> Meter:
    """Power drawn from a battery while it discharges."""
    power = folder / "power_now"
    computed = power.exists()
    facts = Facts(
        name=f"battery {folder.name}",
        unit="uW" if computed else "uV x uA",
        resolution=0.01,
        max_W=2000.0,
        scope=Scope.ROBOT,
        kind=Kind.INTEGRATED,
    )
    if computed:
        drawn = file_meter(facts, power)
    else:
        drawn = file_meter(facts, folder / "voltage_now", folder / "current_now", scale=1e-12)

    def read() -> float:
        status = read_text(folder / "status")
        if status != "Discharging":
            raise MeterLostError(f"{folder.name} is {status.lower() or 'of unknown status'}, not discharging")
        return abs(drawn.read())

    return Meter(facts, read)
