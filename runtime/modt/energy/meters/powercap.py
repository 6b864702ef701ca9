"""The kernel's powercap zones: RAPL energy counters, and power readings of SCMI firmware."""

from __future__ import annotations

from pathlib import Path

from modt.energy.meters.meter import (
    Candidate,
    Facts,
    Kind,
    Meter,
    Scope,
    file_meter,
    number_or_none,
    probe,
    text_or_none,
)

_RAPL_REMEDY = "run as root, grant CAP_DAC_READ_SEARCH, or chmod a+r its energy_uj (a udev rule keeps that)"


def find_powercap(sys: Path) -> list[Candidate]:
    """RAPL packages, the platform counter, SCMI; and every zone left out, with the reason.

    Nested zones are left out, since the outer one includes them; so is the memory-mapped duplicate of a package, and
    all but the top zones of SCMI.
    """
    root = sys / "class" / "powercap"
    zones = sorted(p for p in root.glob("*:*") if p.is_dir())
    if not zones:
        cause = "no zone under /sys/class/powercap"
        remedy = "use bare metal with the intel_rapl_msr or arm_scmi_powercap module; virtual machines have none"
        return [Candidate("powercap", (), cause, remedy)]
    packages: list[Meter] = []
    found: list[Candidate] = []
    for zone in zones:
        label = text_or_none(zone / "name") or "unnamed"
        name = f"powercap {zone.name} ({label})"
        if zone.name.startswith("intel-rapl-mmio"):
            found.append(Candidate(name, (), "the same package again", "none needed: its duplicate is used"))
        elif zone.name.count(":") > 1:
            found.append(Candidate(name, (), f"counted by {zone.name.rpartition(':')[0]}", "none needed"))
        elif not (zone / "energy_uj").exists() and (zone / "power_uw").exists():
            found.append(probe(name, (_scmi(zone, name),), "make its power_uw readable"))
        elif label == "psys":
            found.append(probe(name, (_rapl(zone, name, Scope.BOARD),), _RAPL_REMEDY))
        elif label.startswith("package"):
            packages.append(_rapl(zone, name, Scope.CPU))
        else:
            found.append(Candidate(name, (), "of unknown extent", "none: its scope is not documented"))
    if packages:
        found.insert(0, probe("RAPL packages", tuple(packages), _RAPL_REMEDY))
    return found


def _rapl(zone: Path, name: str, scope: Scope) -> Meter:
    """An energy counter that wraps at the range of its zone."""
    facts = Facts(
        name=name,
        unit="uJ",
        resolution=61e-6,
        max_W=1000.0,
        scope=scope,
        kind=Kind.MEASURED,
        wrap_J=1e-6 * (number_or_none(zone / "max_energy_range_uj") or 0.0) or None,
        privilege="root since Linux 5.10",
    )
    return file_meter(facts, zone / "energy_uj")


def _scmi(zone: Path, name: str) -> Meter:
    facts = Facts(name=name, unit="uW", resolution=1e-3, max_W=1000.0, scope=Scope.SOC, kind=Kind.INTEGRATED)
    return file_meter(facts, zone / "power_uw")
