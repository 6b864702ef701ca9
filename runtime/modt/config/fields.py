"""Fields of a configuration: every value is bounded, and checked when it is set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from typing import Any

from modt.classes import CLASS_NAMES, CLASSES, N_SHIPPED, OBJECTS
from modt.errors import MisuseError

RARE = 0.001
"""Share of a class of the user's own among the proposals, where a profile states those of modt's classes alone."""


class ValueRangeError(MisuseError):
    """A configuration value of the wrong type or out of its range. Its subject is the key."""


def number(default: float | None, low: float, high: float, unit: str, meaning: str) -> Any:
    """Field of a number within bounds."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "meaning": meaning})


def numbers(low: float, high: float, most: int, unit: str, meaning: str, *, pairs: bool = False) -> Any:
    """Field of two to `most` numbers within bounds; in pairs their number is even. The default is null."""
    facts = {"low": low, "high": high, "least": 2, "most": most, "unit": unit, "meaning": meaning}
    return field(default=None, metadata={**facts, "pairs": pairs})


def vector(default: tuple[float, float, float], most: float, unit: str, meaning: str) -> Any:
    """Field of three numbers within -most and most."""
    facts = {"low": -most, "high": most, "least": 3, "most": 3, "unit": unit, "meaning": meaning}
    return field(default=default, metadata=facts)


def choice(default: str, options: tuple[str, ...], meaning: str) -> Any:
    """Field of one name among options."""
    return field(default=default, metadata={"options": options, "meaning": meaning})


def per_class(column: str | None, low: float, high: float, meaning: str, classes: Sequence[int] = OBJECTS) -> Any:
    """Field of a number for each class; the defaults are a column of the class table, null without one.

    A profile may leave out the values of the user's own classes, the last ones.
    """
    values = tuple(getattr(CLASSES[c], column) if column else RARE for c in classes)
    meaning = f"{meaning} Values for {', '.join(CLASS_NAMES[c] for c in classes)}."
    facts = {"low": low, "high": high, "least": len(classes), "most": len(classes), "meaning": meaning}
    own = values[len(classes) - len(CLASSES) + N_SHIPPED :]
    return field(default=values if column else None, metadata={**facts, "own": own})


def completed(declared: Field[Any], value: Any) -> Any:
    """The value of a field by class, with those of the user's own classes where it has none of them."""
    own = declared.metadata.get("own", ())
    complete = isinstance(value, tuple) and len(value) == declared.metadata.get("most", 0) - len(own)
    return (*value, *own) if complete else value


@dataclass(frozen=True, kw_only=True)
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
    key = declared.name
    kind = str(declared.type)
    bounds = declared.metadata
    if not bounds or (value is None and "None" in kind):
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
    numbers = value if "most" in bounds and isinstance(value, tuple) else (value,)
    noun = "a whole number" if whole else "a number"
    span = f"{noun} from {bounds['low']:g} to {bounds['high']:g}"
    if "most" in bounds:
        least = bounds["least"]
        most = bounds["most"]
        span = f"{most if least == most else f'{least} to {most}'} values, each {span}"
        if not least <= len(numbers) <= most:
            raise ValueRangeError(key, f"{len(numbers)} values", f"give {span}")
        if bounds.get("pairs") and len(numbers) % 2:
            raise ValueRangeError(key, f"{len(numbers)} values are no pairs", "give from and to of each, in one list")
    remedy = f"give {span} {bounds.get('unit', '')}".rstrip()
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int if whole else (int, float)):
            raise ValueRangeError(key, f"{value!r} is not {noun}", remedy)
        if not bounds["low"] <= number <= bounds["high"]:
            raise ValueRangeError(key, f"{number!r} is out of range", remedy)
