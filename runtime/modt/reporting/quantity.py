"""A number with its unit, its interval and its kind (measured, integrated, estimated, unavailable)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from modt.energy.meters.meter import Kind

_MARK = {Kind.MEASURED: "", Kind.INTEGRATED: "i", Kind.ESTIMATED: "e"}
LEGEND = "Figures are measured, but for e estimated, i integrated, ? unavailable. In brackets: 95 %."


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of a report.

    Attributes:
        value: None where unavailable.
        unit: empty for a ratio or a count.
        kind: measured, integrated, estimated or unavailable.
        low, high: 95 % interval, None where none was computed.
    """

    value: float | None
    unit: str = ""
    kind: Kind = Kind.MEASURED
    low: float | None = None
    high: float | None = None

    def json(self) -> dict[str, Any]:
        """Value, unit, kind and interval, if any."""
        plain: dict[str, Any] = {"value": self.value, "unit": self.unit, "kind": self.kind.value}
        return plain if self.low is None else plain | {"low": self.low, "high": self.high}

    def text(self) -> str:
        """Value, unit and interval."""
        if self.value is None:
            return "unavailable"
        interval = "" if self.low is None else f" ({format_number(self.low)} to {format_number(self.high)})"
        return f"{format_number(self.value)} {self.unit}".rstrip() + interval

    def marked(self, scale: float = 1.0) -> str:
        """Scaled value and the letter of its kind (LEGEND), without unit and interval."""
        return "unavailable" if self.value is None else format_number(self.value * scale) + _MARK[self.kind]

    def with_kind(self, scale: float = 1.0, unit: str | None = None) -> str:
        """Scaled value, unit and kind in brackets."""
        if self.value is None:
            return "unavailable"
        return (
            f"{format_number(scale * self.value)} {self.unit if unit is None else unit}".rstrip() + f" ({self.kind})"
        )


def quantity(
    value: float | None, unit: str = "", kind: Kind = Kind.MEASURED, interval: tuple[float, float] | None = None
) -> Quantity:
    """A quantity; unavailable, whatever its kind, where the value is None or not finite."""
    if value is None or not math.isfinite(value):
        return Quantity(None, unit, Kind.UNAVAILABLE)
    low, high = interval if interval is not None else (None, None)
    return Quantity(float(value), unit, kind, low, high)


def estimate(value: float | None, unit: str = "", interval: tuple[float, float] | None = None) -> Quantity:
    """An estimated quantity."""
    return quantity(value, unit, Kind.ESTIMATED, interval)


def format_number(value: float | None, digits: int = 3) -> str:
    """A number in that many significant digits, without exponent from 1e-4 to 1e6."""
    if value is None:
        return "-"
    if value and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    decimals = digits - 1 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(decimals, 0)}f}"


def to_json(tree: Any) -> Any:
    """A tree of quantities as plain data."""
    if isinstance(tree, Quantity):
        return tree.json()
    if isinstance(tree, dict):
        return {key: to_json(value) for key, value in tree.items()}
    return [to_json(value) for value in tree] if isinstance(tree, list | tuple) else tree
