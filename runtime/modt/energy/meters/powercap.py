"""The kernel's powercap zones: RAPL counters, and SCMI's power figures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.candidate import Candidate, tried
from modt.energy.meters.meter import Facts, Kind, MeterLostError, Quantity, Scope, known, read_number

RAPL_REMEDY = "run as root, grant CAP_DAC_READ_SEARCH, or chmod a+r its energy_uj (a udev rule keeps that)"


@dataclass(frozen=True, slots=True)
class EnergyZone:
    """A counter in microjoules that starts again at its range."""

    path: Path
    label: str
    scope: Scope

    @property
    def facts(self) -> Facts:
        """Declared by the kernel's interface; the range is the zone's own."""
        try:
            wrap_J = 1e-6 * read_number(self.path / "max_energy_range_uj")
        except MeterLostError:
            wrap_J = None
        return Facts(
            name=f"powercap {self.path.name} ({self.label})",
            quantity=Quantity.ENERGY,
            unit="uJ",
            resolution=61e-6,
            update_s=1e-3,
            wrap_J=wrap_J or None,
            max_W=1000.0,
            scope=self.scope,
            kind=Kind.MEASURED,
            privilege="root since Linux 5.10",
        )

    def read(self) -> float:
        """The counter [J]."""
        return 1e-6 * read_number(self.path / "energy_uj")


@dataclass(frozen=True, slots=True)
class PowerZone:
    """A power figure in microwatts, as SCMI firmware gives it."""

    path: Path
    label: str

    @property
    def facts(self) -> Facts:
        """Declared by the kernel's interface."""
        return Facts(
            name=f"powercap {self.path.name} ({self.label})",
            quantity=Quantity.POWER,
            unit="uW",
            resolution=1e-3,
            update_s=0.1,
            wrap_J=None,
            max_W=1000.0,
            scope=Scope.SOC,
            kind=Kind.INTEGRATED,
            privilege="none",
        )

    def read(self) -> float:
        """The power now [W]."""
        return 1e-6 * read_number(self.path / "power_uw")


def find_powercap(sys: Path) -> list[Candidate]:
    """RAPL packages, the platform counter, SCMI; and every zone left out, with the reason.

    Zones inside a zone are left out, for the outer one counts them already; so is the memory-mapped twin of a
    package, and anything but the top zones of SCMI.
    """
    root = sys / "class" / "powercap"
    zones = sorted(p for p in root.glob("*:*") if p.is_dir())
    if not zones:
        cause = "no zone under /sys/class/powercap"
        remedy = "use bare metal with the intel_rapl_msr or arm_scmi_powercap module; virtual machines have none"
        return [Candidate("powercap", (), cause, remedy)]
    packages: list[EnergyZone] = []
    found: list[Candidate] = []
    for zone in zones:
        label = known(zone / "name") or "unnamed"
        name = f"powercap {zone.name} ({label})"
        if zone.name.startswith("intel-rapl-mmio"):
            found.append(Candidate(name, (), "the same package again", "none needed: its twin is used"))
        elif zone.name.count(":") > 1:
            found.append(Candidate(name, (), f"counted by {zone.name.rpartition(':')[0]}", "none needed"))
        elif not (zone / "energy_uj").exists() and (zone / "power_uw").exists():
            found.append(tried(name, (PowerZone(zone, label),), "make its power_uw readable"))
        elif label == "psys":
            found.append(tried(name, (EnergyZone(zone, label, Scope.BOARD),), RAPL_REMEDY))
        elif label.startswith("package"):
            packages.append(EnergyZone(zone, label, Scope.CPU))
        else:
            found.append(Candidate(name, (), "of unknown extent", "name it, if you know what it covers"))
    if packages:
        found.insert(0, tried("RAPL packages", tuple(packages), RAPL_REMEDY))
    return found
