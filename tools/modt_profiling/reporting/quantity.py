"""A number with its unit, its interval and its kind (measured, integrated, estimated, unavailable)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from modt.energy.meters.meter import Kind

_MARKS = {Kind.MEASURED: "", Kind.INTEGRATED: "i:", Kind.ESTIMATED: "~"}
LEGEND = "~ estimated; i: integrated power; no mark: read or counted. In brackets: 95 % intervals."


@dataclass(frozen=True)
class Quantity:
    """One number of a report."""

    value: float | None  # None where unavailable
    unit: str = ""  # empty for a ratio or a count
    kind: Kind = Kind.MEASURED
    low: float | None = None  # 95 % interval, None where none was computed
    high: float | None = None

    def json(self) -> dict[str, Any]:
        """Value, unit, kind and interval, if any."""
        plain: dict[str, Any] = {"value": self.value, "unit": self.unit, "kind": self.kind.value}
        return plain if self.low is None else plain | {"low": self.low, "high": self.high}

    def scaled(self, factor: float, unit: str) -> Quantity:
        """Quantity in another unit."""

        def scale(number: float | None) -> float | None:
            return None if number is None else factor * number

        return replace(self, value=scale(self.value), unit=unit, low=scale(self.low), high=scale(self.high))

    def marked(self) -> str:
        """Mark of its kind (LEGEND), value and unit."""
        return self.number() if self.value is None else _MARKS[self.kind] + self.number()

    def text(self) -> str:
        """Mark, value, unit, and the interval if its ends differ in the digits shown."""
        interval = self.interval()
        return self.marked() + (f" ({interval})" if interval else "")

    def interval(self) -> str:
        """Ends of the interval; empty if they do not differ in the digits shown."""
        low = format_number(self.low)
        high = format_number(self.high)
        return f"{low} to {high}" if low != high else ""

    def number(self) -> str:
        """Value and unit, without its kind."""
        return "unavailable" if self.value is None else f"{format_number(self.value)} {self.unit}".rstrip()


def quantity(
    value: float | None, unit: str = "", kind: Kind = Kind.MEASURED, interval: tuple[float, float] | None = None
) -> Quantity:
    """A quantity; unavailable, whatever its kind, where the value is None or not finite."""
    if value is None or not math.isfinite(value):
        return Quantity(None, unit, Kind.UNAVAILABLE)
    low, high = interval if interval is not None else (None, None)
    return Quantity(value if isinstance(value, int) else float(value), unit, kind, low, high)


def estimate(value: float | None, unit: str = "", interval: tuple[float, float] | None = None) -> Quantity:
    """An estimated quantity."""
    return quantity(value, unit, Kind.ESTIMATED, interval)


def from_json(plain: dict[str, Any]) -> Quantity:
    """A quantity from what its `json` has returned.

    Raises:
        KeyError, ValueError: it is none.
    """
    numbers = (plain["value"], plain.get("low"), plain.get("high"))
    if not all(number is None or isinstance(number, int | float) for number in numbers):
        raise ValueError(f"{numbers} for a number and its bounds")
    value, low, high = numbers
    return Quantity(value, plain["unit"], Kind(plain["kind"]), low, high)


def format_number(value: float | None) -> str:
    """A number in three significant digits, without exponent from 1e-4 to 1e6; a count with all of them."""
    if value is None:
        return "-"
    if isinstance(value, int):
        return str(value)
    if value and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.2e}"
    decimals = 2 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(decimals, 0)}f}"


def to_json(tree: Any) -> Any:
    """A tree of quantities as plain data."""
    if isinstance(tree, Quantity):
        return tree.json()
    if isinstance(tree, dict):
        return {key: to_json(value) for key, value in tree.items()}
    return [to_json(value) for value in tree] if isinstance(tree, list | tuple) else tree


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines of aligned columns, the first to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *others in rows:
        cells = (f"{cell:>{width}}" for cell, width in zip(others, widths[1:], strict=True))
        yield "  ".join([f"  {first:<{widths[0]}}", *cells])
