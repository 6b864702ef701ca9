"""Configuration: one frozen dataclass a stage, every value bounded and checked as it is made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any

from modt.classes import CLASS_NAMES, CLASSES, OBJECTS, ObjectClass
from modt.errors import MisuseError


class ValueRangeError(MisuseError):
    """A configuration value of the wrong type or out of its range; key says which."""

    def __init__(self, key: str, cause: str, remedy: str) -> None:
        super().__init__(key, cause, remedy)
        self.key = key


def number(default: float | None, low: float, high: float, unit: str, meaning: str) -> Any:
    """Field of a number within bounds."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "meaning": meaning})


def numbers(low: float, high: float, most: int, unit: str, meaning: str, *, pairs: bool = False) -> Any:
    """Field of two to `most` numbers within bounds; in pairs their number is even. The default is null."""
    facts = {"low": low, "high": high, "least": 2, "most": most, "unit": unit, "meaning": meaning}
    return field(default=None, metadata={**facts, "pairs": pairs})


def choice(default: str, options: tuple[str, ...], meaning: str) -> Any:
    """Field of one name among options."""
    return field(default=default, metadata={"options": options, "meaning": meaning})


def per_class(column: str, low: float, high: float, meaning: str, classes: tuple[ObjectClass, ...] = OBJECTS) -> Any:
    """Field of a number for each class; the defaults are a column of the class table."""
    values = tuple(getattr(CLASSES[c], column) for c in classes)
    meaning = f"{meaning} Values for {', '.join(CLASS_NAMES[c] for c in classes)}."
    return field(default=values, metadata={"low": low, "high": high, "length": len(classes), "meaning": meaning})


def shares(high: float, meaning: str) -> Any:
    """Field of a share for each class of objects. The default is null."""
    meaning = f"{meaning} Values for {', '.join(CLASS_NAMES[c] for c in OBJECTS)}."
    return field(default=None, metadata={"low": 0.0001, "high": high, "length": len(OBJECTS), "meaning": meaning})


@dataclass(frozen=True, slots=True, kw_only=True)
class StageConfig:
    """Base of every stage's configuration: checks each value against its declared bounds.

    Raises:
        ValueRangeError: a value is not of its kind or out of range.
    """

    def __post_init__(self) -> None:
        for f in fields(self):
            check(f, getattr(self, f.name))


def check(declared: Field[Any], value: object) -> None:
    """Check a value against the bounds that its field declares.

    Raises:
        ValueRangeError: it is not of its kind or out of range.
    """
    key, kind, bounds = declared.name, str(declared.type), declared.metadata
    if value is None and "None" in kind:
        return
    if "options" in bounds:
        if value not in bounds["options"]:
            raise ValueRangeError(key, f"{value!r} is unknown", f"use one of {', '.join(bounds['options'])}")
    elif kind == "str":
        if not isinstance(value, str):
            raise ValueRangeError(key, f"{value!r} is no text", "write a name")
    else:
        _check_numbers(key, value, kind.startswith("int"), bounds)


def _check_numbers(key: str, value: object, whole: bool, bounds: Mapping[str, Any]) -> None:
    several = "length" in bounds or "most" in bounds
    numbers = value if several and isinstance(value, tuple) else (value,)
    noun = "a whole number" if whole else "a number"
    span = f"{noun} from {bounds['low']:g} to {bounds['high']:g}"
    if "length" in bounds:
        span = f"{bounds['length']} values, each {span}"
        if len(numbers) != bounds["length"]:
            raise ValueRangeError(key, f"{value!r} does not fit", f"give {span}")
    if "most" in bounds:
        span = f"{bounds['least']} to {bounds['most']} values, each {span}"
        if not bounds["least"] <= len(numbers) <= bounds["most"]:
            raise ValueRangeError(key, f"{len(numbers)} values", f"give {span}")
        if bounds["pairs"] and len(numbers) % 2:
            raise ValueRangeError(key, f"{len(numbers)} values are no pairs", "give from and to of each, in one list")
    remedy = f"give {span} {bounds.get('unit', '')}".rstrip()
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int if whole else (int, float)):
            raise ValueRangeError(key, f"{value!r} is not {noun}", remedy)
        if not bounds["low"] <= number <= bounds["high"]:
            raise ValueRangeError(key, f"{number!r} is out of range", remedy)
