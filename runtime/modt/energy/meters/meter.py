"""Meters: their facts, their readings, and the candidates of discovery."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from modt.config import EnergyConfig


class Words(str, Enum):
    """Base of enumerations whose members are written as their values."""

    __str__ = str.__str__


class Kind(Words):
    """Reliability of a figure. Every figure shown carries one."""

    MEASURED = "measured"  # counted by hardware or by this program
    INTEGRATED = "integrated"  # power samples integrated over time
    ESTIMATED = "estimated"  # computed from assumptions
    UNAVAILABLE = "unavailable"


def worst(kinds: Iterable[Kind]) -> Kind:
    """The least reliable of some kinds, which is the kind of their sum."""
    return max(kinds, key=list(Kind).index)


class Scope(Words):
    """Consumers that a meter covers, in order of preference. This program has a larger share of a narrower scope."""

    CPU = "CPU packages"
    CPU_RAIL = "the rail of the CPU, with what shares it"
    SOC = "system on chip"
    MODULE = "the module, without what its carrier board feeds"
    BOARD = "whole board"
    ROBOT = "everything on the battery"
    RAIL = "one rail, of unknown extent"
    PROCESS = "this process, by a model"


class MeterLostError(Exception):
    """A meter cannot be read now."""


@dataclass(frozen=True)
class Facts:
    """Static properties of a meter."""

    name: str
    unit: str  # unit of the device's own readings
    resolution: float  # smallest step of a reading [J or W]
    max_W: float  # power beyond its range
    scope: Scope  # consumers covered
    kind: Kind  # reliability of the energy derived from it
    wrap_J: float | None = None  # range of an energy counter; None where it never wraps, or the range is unknown
    privilege: str = "none"  # needed to read it

    @property
    def counts(self) -> bool:
        """Whether a reading is an energy [J], or else a momentary power [W]."""
        return self.kind is not Kind.INTEGRATED

    def resolution_J(self, seconds: float) -> float:
        """Smallest step of the energy of an interval [J]."""
        return self.resolution * (1.0 if self.counts else seconds)

    @property
    def must_draw(self) -> bool:
        """Whether its consumers draw power whenever this program runs."""
        return self.scope not in (Scope.PROCESS, Scope.RAIL)


@dataclass(frozen=True)
class Meter:
    """One sensor or counter."""

    facts: Facts
    read: Callable[[], float]
    """Present value [J or W, by facts.counts]; raises MeterLostError."""


def file_meter(facts: Facts, *paths: Path, scale: float = 1e-6) -> Meter:
    """Meter whose value is the scaled product of the integers in its files: a value, or voltage and current."""
    return Meter(facts, lambda: scale * math.prod(read_number(path) for path in paths))


def read_text(path: Path) -> str:
    """Content of a small file, stripped. Raises MeterLostError with the reason."""
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError as error:
        raise MeterLostError(f"{path}: {error.strerror}") from None


def read_number(path: Path) -> float:
    """An integer written by the kernel. Raises MeterLostError with the reason."""
    text = read_text(path)
    try:
        return float(int(text))
    except (ValueError, OverflowError):
        raise MeterLostError(f"{path}: {text[:40]!r} is not a number") from None


def text_or_none(path: Path) -> str | None:
    """Content of a small file, None where it cannot be read."""
    with suppress(MeterLostError):
        return read_text(path)
    return None


def number_or_none(path: Path) -> float | None:
    """An integer written by the kernel, None where it cannot be read."""
    with suppress(MeterLostError):
        return read_number(path)
    return None


@dataclass(frozen=True)
class Candidate:
    """Meters whose readings may be summed, since their scopes do not overlap, usable or not."""

    name: str
    meters: tuple[Meter, ...]  # one per socket or rail; empty where none of this type exists
    why_not: str = ""  # reason against its use
    remedy: str = ""  # action that makes it usable

    @property
    def usable(self) -> bool:
        """Whether it can be read."""
        return bool(self.meters) and not self.why_not

    @property
    def facts(self) -> Facts | None:
        """Facts of the first meter. The meters of a candidate are alike."""
        return self.meters[0].facts if self.meters else None


def probe(name: str, meters: tuple[Meter, ...], remedy: str) -> Candidate:
    """A candidate whose meters are read once to find out whether they are usable."""
    try:
        for meter in meters:
            meter.read()
    except MeterLostError as error:
        return Candidate(name, meters, str(error), remedy)
    return Candidate(name, meters)


def model_meter(board: EnergyConfig, wall_ns: Callable[[], int], cpu_ns: Callable[[], int]) -> Meter:
    """A meter that computes the energy of this process by `model_J`, from a monotonic clock and its CPU time."""
    most_W = max(board.idle_W, board.busy_W) * 1024
    facts = Facts(model_name(board), "J", 1e-9, most_W, Scope.PROCESS, Kind.ESTIMATED)
    return Meter(facts, lambda: model_J(board, wall_ns(), cpu_ns()))


def model_J(board: EnergyConfig, wall_ns: int, cpu_ns: int) -> float:
    """E = P_idle T + (P_busy - P_idle) t of wall time T and CPU time t [J]."""
    return 1e-9 * (board.idle_W * wall_ns + board.active_W * cpu_ns)


def model_name(board: EnergyConfig) -> str:
    """Display name of the model of a board."""
    return f"model {board.idle_W:g} W idle, {board.busy_W:g} W busy"


@dataclass(frozen=True)
class Conditions:
    """Clock policy, frequency and temperature of a core, as sysfs shows them."""

    core: int = 0
    sys: Path = Path("/sys")

    def read(self) -> dict[str, str | float | None]:
        """Governor, frequency [MHz] and temperature [degrees Celsius], or None where not available."""
        cpufreq = self.sys / "devices" / "system" / "cpu" / f"cpu{self.core}" / "cpufreq"
        frequency_kHz = number_or_none(cpufreq / "scaling_cur_freq")
        temperature_mC = number_or_none(self.sys / "class" / "thermal" / "thermal_zone0" / "temp")
        return {
            "governor": text_or_none(cpufreq / "scaling_governor"),
            "frequency_MHz": None if frequency_kHz is None else 1e-3 * frequency_kHz,
            "temperature_C": None if temperature_mC is None else 1e-3 * temperature_mC,
        }
