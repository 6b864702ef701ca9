"""What a meter declares and how it is read."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Protocol


class Kind(StrEnum):
    """How far a figure can be trusted; every figure shown carries one."""

    MEASURED = "measured"
    """Counted by hardware or by this program."""
    INTEGRATED = "integrated"
    """Power samples, added up over time."""
    ESTIMATED = "estimated"
    """Computed from assumptions."""
    UNAVAILABLE = "unavailable"
    """Nobody knows."""


class Quantity(StrEnum):
    """What one reading is."""

    ENERGY = "energy"
    """Counts up [J]."""
    POWER = "power"
    """Of this moment [W]."""


class Scope(StrEnum):
    """What a meter's figure covers, from the narrowest."""

    PROCESS = "this process, by a model"
    CPU = "CPU packages"
    SOC = "system on chip"
    BOARD = "whole board"
    ROBOT = "everything on the battery"
    RAIL = "one rail, of unknown extent"


class MeterLostError(Exception):
    """The meter cannot be read now."""


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of a meter without reading it.

    Attributes:
        name: for people.
        quantity: what a reading is.
        unit: of the device's own figure.
        resolution: smallest step of a reading [J or W].
        update_s: time between the device's own updates [s].
        wrap_J: an energy counter starts again at 0 after this much [J]; None where it never does, or nobody knows.
        max_W: no reading can honestly exceed this power [W].
        scope: what it covers.
        kind: what the energy taken from it is.
        privilege: needed to read it.
    """

    name: str
    quantity: Quantity
    unit: str
    resolution: float
    update_s: float
    wrap_J: float | None
    max_W: float
    scope: Scope
    kind: Kind
    privilege: str


class Meter(Protocol):
    """One sensor or counter."""

    @property
    def facts(self) -> Facts:
        """What it declares."""
        ...

    def read(self) -> float:
        """The figure now [J or W, by its quantity].

        Raises:
            MeterLostError: it cannot be read now.
        """
        ...


def read_text(path: Path) -> str:
    """First line of a small file.

    Raises:
        MeterLostError: missing or unreadable; it says why.
    """
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError as error:
        raise MeterLostError(f"{path}: {error.strerror}") from None


def read_number(path: Path) -> float:
    """A whole number that the kernel wrote.

    Raises:
        MeterLostError: missing, unreadable or no number.
    """
    text = read_text(path)
    try:
        return float(int(text))
    except ValueError:
        raise MeterLostError(f"{path}: {text!r} is no number") from None


def known(path: Path) -> str | None:
    """First line of a small file, None where it cannot be read."""
    try:
        return read_text(path)
    except MeterLostError:
        return None
