"""Texts that add conditions to a simulation: NAME:VALUE, and @SECONDS for a condition that begins late."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from modt.errors import MisuseError
from modt.types import Self


@dataclass(frozen=True)
class Condition:
    """A condition by its name, its numbers and the time at which it begins."""

    name: str
    values: tuple[float, ...]
    from_s: float = 0.0

    @classmethod
    def of(cls, text: str, kinds: Mapping[str, tuple[str, ...]]) -> Self:
        """Read a text such as `sector:20:30@10`, by the names of the values of each kind of condition.

        Raises:
            MisuseError: an unknown kind, another number of values, or no numbers.
        """
        body, at, begin = text.partition("@")
        name, *numbers = body.split(":")
        forms = ", ".join(":".join([kind, *values]) for kind, values in kinds.items())
        if name not in kinds or len(numbers) != len(kinds[name]):
            raise MisuseError(
                text, "no such condition", f"use one of {forms}, with @SECONDS for one that begins late"
            )
        try:
            values = tuple(float(number) for number in numbers)
            from_s = float(begin) if at else 0.0
        except ValueError:
            raise MisuseError(text, "a value is no number", f"use one of {forms}") from None
        if not all(isfinite(value) and value >= 0 for value in (*values, from_s)):
            raise MisuseError(text, "a value is negative or not finite", f"use one of {forms}")
        return cls(name, values, from_s)
