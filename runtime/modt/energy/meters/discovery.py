"""Search for the meters of a machine in sysfs and in the chip of a Raspberry Pi 5."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from modt.config import EnergyConfig
from modt.energy.meters.meter import (
    Candidate,
    Facts,
    Kind,
    Meter,
    MeterLostError,
    Scope,
    file_meter,
    model_meter,
    number_or_none,
    probe,
    read_text,
    text_or_none,
)

_RAPL_REMEDY = "run as root, grant CAP_DAC_READ_SEARCH, or chmod a+r its energy_uj (a udev rule keeps that)"
_SAME_J = 1e-3
"""Readings of two zones that differ by no more than this may show one counter [J]."""


def find_powercap(sys: Path) -> list[Candidate]:
    """RAPL packages, the platform counter and SCMI, and every zone that is left out with the reason.

    Nested zones are left out, since the outer one includes them; so is a memory-mapped zone beside the same package,
    a zone that shows the counter of another one, and all but the top zones of SCMI.
    """
    root = sys / "class" / "powercap"
    zones = sorted(p for p in root.glob("*:*") if p.is_dir())
    if not zones:
        cause = "no zone under /sys/class/powercap"
        remedy = "use bare metal with the intel_rapl_msr or arm_scmi_powercap module; virtual machines have none"
        return [Candidate("powercap", (), cause, remedy)]
    labels = {zone.name: text_or_none(zone / "name") or "unnamed" for zone in zones}
    registers = {label for name, label in labels.items() if not name.startswith("intel-rapl-mmio")}
    packages: list[Meter] = []
    found: list[Candidate] = []
    for zone in zones:
        label = labels[zone.name]
        name = f"powercap {zone.name} ({label})"
        if zone.name.count(":") > 1:
            found.append(Candidate(name, (), f"counted by {zone.name.rpartition(':')[0]}", "none needed"))
        elif zone.name.startswith("intel-rapl-mmio") and label in registers:
            found.append(Candidate(name, (), "the same package again", "none needed: its duplicate is used"))
        elif label.startswith("package") and not _shows_power(zone):
            packages.append(_rapl(zone, name, Scope.CPU))
        else:
            found.append(_other_zone(zone, name, label))
    return _packages(packages) + found


def _other_zone(zone: Path, name: str, label: str) -> Candidate:
    """A zone of SCMI, or the platform counter; any other one is of unknown extent."""
    if _shows_power(zone):
        facts = Facts(name, "uW", 1e-3, 1000.0, Scope.SOC, Kind.INTEGRATED)
        return probe(name, (file_meter(facts, zone / "power_uw"),), "make its power_uw readable")
    if label == "psys":
        return probe(name, (_rapl(zone, name, Scope.BOARD),), _RAPL_REMEDY)
    return Candidate(name, (), "of unknown extent", "none: its scope is not documented")


def _shows_power(zone: Path) -> bool:
    """Whether it is a zone of SCMI, which has no counter of energy."""
    return not (zone / "energy_uj").exists() and (zone / "power_uw").exists()


def _packages(meters: list[Meter]) -> list[Candidate]:
    """All packages as one candidate. A package whose readings lie between those of another shows the same counter."""
    if not meters:
        return []
    try:
        rounds = [*pairwise([meter.read() for meter in meters] for _ in range(4))]
    except MeterLostError:
        rounds = []
    used: list[int] = []
    found: list[Candidate] = []
    for k, meter in enumerate(meters):
        # Counters count all the time: one that is read after another and shows the same lies between two readings.
        twins = (j for j in used if rounds and all(a[j] - _SAME_J <= a[k] <= b[j] + _SAME_J for a, b in rounds))
        twin = next(twins, None)
        if twin is None:
            used.append(k)
        else:
            cause = f"shows the counter of {meters[twin].facts.name}"
            found.append(Candidate(meter.facts.name, (), cause, "none needed: it is counted once"))
    return [probe("RAPL packages", tuple(meters[k] for k in used), _RAPL_REMEDY), *found]


def _rapl(zone: Path, name: str, scope: Scope) -> Meter:
    """An energy counter that wraps at the range of its zone."""
    range_J = 1e-6 * (number_or_none(zone / "max_energy_range_uj") or 0.0) or None
    facts = Facts(name, "uJ", 61e-6, 1000.0, scope, Kind.MEASURED, range_J, "root since Linux 5.10")
    return file_meter(facts, zone / "energy_uj")


@dataclass(frozen=True)
class Board:
    """A board whose power rails are known, recognised by the model in its device tree and the labels of its rails.

    Sources: NVIDIA's Jetson Linux developer guides and product design guides, and the device trees of the kernel.
    """

    name: str
    model: str  # pattern in the model of the device tree
    whole: tuple[str, ...]  # rails whose sum is the module's power
    cpu: str  # narrowest rail with the CPU
    parts: tuple[str, ...] = ()  # rails side by side that one of the whole feeds


BOARDS = (
    Board("Jetson Nano", r"Jetson Nano", ("POM_5V_IN",), "POM_5V_CPU", ("POM_5V_CPU", "POM_5V_GPU")),
    Board("Jetson NX", r"Xavier NX|Orin (NX|Nano)", ("VDD_IN",), "VDD_CPU_GPU_CV", ("VDD_CPU_GPU_CV", "VDD_SOC")),
    Board("Jetson AGX Xavier", r"AGX Xavier|Jetson-AGX", ("GPU", "CPU", "SOC", "CV", "VDDRQ", "SYS5V"), "CPU"),
    Board("Jetson AGX Orin", r"AGX Orin", ("VDD_GPU_SOC", "VDD_CPU_CV", "VIN_SYS_5V0"), "VDD_CPU_CV"),
)


_INA_CHIPS = ("ina219", "ina220", "ina226", "ina230", "ina231", "ina238", "ina3221")
_PART_SHARE = 1.1
"""A module is refused if the rails that it feeds draw more than this factor of its own power."""


def find_hwmon(sys: Path) -> list[Candidate]:
    """A candidate for the module of a known board (its supply rail or a sum of rails), then for each rail.

    Rails may feed one another, so only those of a known board are summed. A board is known by its model in the device
    tree and its rails; by the rails alone where there is no model.
    """
    folders = sorted((sys / "class" / "hwmon").glob("hwmon*"), key=lambda p: (len(p.name), p.name))
    rails: dict[str, Meter] = {}
    for folder in folders:
        chip = text_or_none(folder / "name")
        if chip in _INA_CHIPS:
            for label, meter in _rails(folder, chip).items():
                rails[f"{label} of {folder.name}" if label in rails else label] = meter
    if not rails:
        remedy = "wire an INA219, INA226 or INA3221 into the supply and load its driver"
        return [Candidate("hwmon", (), "no power monitor under /sys/class/hwmon", remedy)]
    model = text_or_none(sys / "firmware/devicetree/base/model") or ""
    fitting = (b for b in BOARDS if rails.keys() >= {b.cpu, *b.whole} and (not model or re.search(b.model, model)))
    board = next(fitting, None)
    remedy = "make the chip's inputs readable"
    found = [] if board is None else [_module(board, rails, remedy)]
    for label, meter in rails.items():
        if board is None or board.whole != (label,):
            of_cpu = board is not None and label == board.cpu
            rail = _scoped(meter, Scope.CPU_RAIL) if of_cpu else meter
            found.append(probe(rail.facts.name, (rail,), remedy))
    return found


def _module(board: Board, rails: dict[str, Meter], remedy: str) -> Candidate:
    """The supply of a board, refused if the rails that it feeds draw more."""
    whole = tuple(_scoped(rails[label], Scope.MODULE) for label in board.whole)
    summed = f"{board.name} module ({' + '.join(board.whole)})"
    module = probe(summed if len(whole) > 1 else whole[0].facts.name, whole, remedy)
    parts = [rails[label] for label in board.parts if label in rails]
    try:
        beyond = sum(m.read() for m in parts) > _PART_SHARE * sum(m.read() for m in whole)
    except MeterLostError:
        return module
    cause = "less than the rails that it feeds"
    return replace(module, why_not=cause, remedy="check shunts and labels") if beyond else module


def _scoped(meter: Meter, scope: Scope) -> Meter:
    return replace(meter, facts=replace(meter.facts, scope=scope))


def _rails(folder: Path, chip: str) -> dict[str, Meter]:
    """Meters of the enabled and connected channels, by label: the power that the chip computes, or voltage x current.

    The fourth channel of an INA3221 is the sum of the others.
    """
    rails = {}
    names = (p.name for p in folder.glob("curr[0-9]*_input"))
    for n in sorted(int(name[len("curr") : -len("_input")]) for name in names):
        voltage, current, power = (folder / f"{prefix}{n}_input" for prefix in ("in", "curr", "power"))
        label = text_or_none(folder / f"in{n}_label") or f"{folder.name} channel {n}"
        if n > 3 or text_or_none(folder / f"in{n}_enable") == "0" or not voltage.exists() or label == "NC":
            continue
        computed = power.exists()
        unit = "uW" if computed else "mV x mA"
        step_W = 5e-3  # 1 mA at 5 V
        facts = Facts(f"hwmon {chip} {label}", unit, step_W, 500.0, Scope.RAIL, Kind.INTEGRATED)
        rails[label] = file_meter(facts, *((power,) if computed else (voltage, current)))
    return rails


def find_batteries(sys: Path) -> list[Candidate]:
    """A candidate for all batteries of the machine itself; batteries of peripherals (scope Device) are left out."""
    supplies = sorted((sys / "class" / "power_supply").glob("*"))
    batteries = [
        p for p in supplies if text_or_none(p / "type") == "Battery" and text_or_none(p / "scope") != "Device"
    ]
    if not batteries:
        remedy = "run from a battery with a fuel gauge"
        return [Candidate("battery", (), "none under /sys/class/power_supply", remedy)]
    meter = _sum_of(batteries) if len(batteries) > 1 else _battery(batteries[0])
    return [probe(meter.facts.name, (meter,), "unplug the charger")]


RESTING = ("Full", "Not charging")
"""Status of a battery that gives nothing while another one discharges."""


def _sum_of(folders: Sequence[Path]) -> Meter:
    """Power drawn from several batteries, of which at least one discharges and none is charged."""
    meters = {folder: _battery(folder) for folder in folders}
    first = next(iter(meters.values())).facts
    facts = replace(first, name=f"batteries {' + '.join(folder.name for folder in folders)}")

    def read() -> float:
        drawn = [folder for folder in folders if read_text(folder / "status") not in RESTING]
        if not drawn:
            raise MeterLostError("no battery is discharging")
        return sum(meters[folder].read() for folder in drawn)

    return Meter(facts, read)


def _battery(folder: Path) -> Meter:
    """Power drawn from a battery while it discharges."""
    power = folder / "power_now"
    computed = power.exists()
    unit = "uW" if computed else "uV x uA"
    facts = Facts(f"battery {folder.name}", unit, 0.01, 2000.0, Scope.ROBOT, Kind.INTEGRATED)
    product = file_meter(facts, folder / "voltage_now", folder / "current_now", scale=1e-12)
    drawn = file_meter(facts, power) if computed else product

    def read() -> float:
        status = read_text(folder / "status")
        if status != "Discharging":
            raise MeterLostError(f"{folder.name} is {status.lower() or 'of unknown status'}, not discharging")
        return abs(drawn.read())

    return Meter(facts, read)


_RAIL_VALUE = re.compile(r"(\S+)_([AV])\s+(?:current|volt)\(\d+\)=(\S*)[AV](?!\S)")
_STEP_W = 0.02  # one step of the converter
_FACTS = Facts("Raspberry Pi 5 PMIC", "V x A", _STEP_W, 50.0, Scope.MODULE, Kind.INTEGRATED, privilege="group video")


def find_pmic(command: str) -> list[Candidate]:
    """The power chip of a Raspberry Pi 5, where the command of the firmware is installed.

    Loads on the 5 V rail itself (USB, HATs, the fan) and the loss of the chip are not included. A reading takes a few
    milliseconds of another process.
    """
    path = shutil.which(command)
    if path is None:
        return [Candidate(_FACTS.name, (), f"no {command} here", "on a Raspberry Pi 5, install raspi-utils")]
    rails: set[str] = set()
    meter = Meter(_FACTS, lambda: rail_power_W(_adc_text(path), rails))
    return [probe(_FACTS.name, (meter,), "on a Raspberry Pi 5, add the user to group video")]


def _adc_text(command: str) -> str:
    """Currents and voltages of the rails, as the command prints them."""
    arguments = [command, "pmic_read_adc"]
    try:
        done = subprocess.run(arguments, capture_output=True, text=True, errors="replace", timeout=2.0, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MeterLostError(f"{command}: {error}") from None
    if done.returncode:
        output = (done.stderr or done.stdout).strip().splitlines()
        raise MeterLostError(f"{command}: {output[0] if output else f'exit status {done.returncode}'}")
    return done.stdout


def rail_power_W(text: str, known: set[str]) -> float:
    """Sum of voltage times current over the rails of `vcgencmd pmic_read_adc`. No `known` rail may be missing."""
    amperes: dict[str, float] = {}
    volts: dict[str, float] = {}
    for rail, quantity, value in _RAIL_VALUE.findall(text):
        try:
            (amperes if quantity == "A" else volts)[rail] = float(value)
        except ValueError:
            raise MeterLostError(f"pmic_read_adc: {rail} is {value[:20]!r}, not a number") from None
    rails = amperes.keys() & volts.keys()
    if not rails:
        raise MeterLostError("pmic_read_adc shows no rail with voltage and current (only a Raspberry Pi 5 does)")
    if missing := known - rails:
        raise MeterLostError(f"pmic_read_adc lacks {min(missing)}")
    known |= rails
    return sum(amperes[rail] * volts[rail] for rail in sorted(rails))


FINDERS = (find_powercap, find_hwmon, find_batteries)
"""Functions that search sysfs, mounted at a path, for candidates of one type of meter."""


@dataclass(frozen=True)
class Discovery:
    """The meters of a machine: usable ones, the best first, then the others with the reason."""

    candidates: tuple[Candidate, ...]

    @property
    def best(self) -> Candidate:
        """The first usable candidate. The model is always usable."""
        return next(c for c in self.candidates if c.usable)


def discover(board: EnergyConfig, sys: Path = Path("/sys"), vcgencmd: str = "vcgencmd") -> Discovery:
    """Search for every type of meter. The model of the board is the last of the usable ones."""
    model = model_meter(board, time.monotonic_ns, time.process_time_ns)
    found = [candidate for find in FINDERS for candidate in find(sys)]
    found += [*find_pmic(vcgencmd), Candidate(model.facts.name, (model,))]
    return Discovery(tuple(sorted(found, key=_rank)))


def _rank(candidate: Candidate) -> tuple[int, int, int]:
    facts = candidate.facts
    if facts is None or not candidate.usable:
        return (1, 0 if facts else 1, 0)
    return (0, list(Kind).index(facts.kind), list(Scope).index(facts.scope))
