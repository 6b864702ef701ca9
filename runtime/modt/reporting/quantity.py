"""A figure with its unit, its interval and its kind: how far it can be trusted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from modt.energy.meters.meter import Kind


@dataclass(frozen=True, slots=True)
class Figure:
    """One number of a report.

    Attributes:
        value: None where it is unavailable.
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
        """As plain data."""
        plain: dict[str, Any] = {"value": self.value, "unit": self.unit, "kind": self.kind.value}
        if self.low is not None:
            plain |= {"low": self.low, "high": self.high}
        return plain

    def text(self, digits: int = 3) -> str:
        """With unit and interval."""
        if self.value is None:
            return "unavailable"
        unit = f" {self.unit}" if self.unit else ""
        spread = f" ({brief(self.low, digits)} to {brief(self.high, digits)})" if self.low is not None else ""
        return f"{brief(self.value, digits)}{unit}{spread}"


def figure(
    value: float | None, unit: str = "", kind: Kind = Kind.MEASURED, interval: tuple[float, float] | None = None
) -> Figure:
    """A figure; unavailable where there is no finite value, whatever kind it would have been."""
    if value is None or not math.isfinite(value):
        return Figure(None, unit, Kind.UNAVAILABLE)
    low, high = interval if interval is not None else (None, None)
    return Figure(float(value), unit, kind, low, high)


def brief(value: float | None, digits: int = 3) -> str:
    """A number in so many significant digits, without exponent where that is readable."""
    if value is None:
        return "-"
    if value and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    decimals = digits - 1 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(decimals, 0)}f}"


def plain(tree: Any) -> Any:
    """A tree of figures as JSON's data."""
    if isinstance(tree, Figure):
        return tree.json()
    if isinstance(tree, dict):
        return {key: plain(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [plain(value) for value in tree]
    return tree
