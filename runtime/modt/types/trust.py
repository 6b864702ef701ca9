"""How far what is reported can be believed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from modt.types.arrays import Self


class TrustLevel(IntEnum):
    """How far what is reported can be believed, from best to worst."""

    GOOD = 0
    DEGRADED = 1  # a part of the view, or a source beside the sweeps, is wrong
    BLIND = 2  # what is reported does not follow from what is around


@dataclass(frozen=True)
class Reason:
    """A cause for less than good trust.

    Attributes:
        key: name of the check.
        level: what it makes of the trust.
        cause, remedy: phrases for people.
        since_s: time of the frame with which it began [s].
    """

    key: str
    level: TrustLevel
    cause: str
    remedy: str
    since_s: float


@dataclass(frozen=True)
class Trust:
    """Whether what is reported can be believed, since when [s], and the reasons against it."""

    level: TrustLevel = TrustLevel.GOOD
    since_s: float = 0.0
    reasons: tuple[Reason, ...] = ()
    visibility_m: float | None = None  # meteorological visibility, None where it is good or not known

    def after(self, reasons: Iterable[Reason], now_s: float) -> Self:
        """The trust that follows this one, by the reasons that there are now, the worst and oldest first."""
        ordered = tuple(sorted(reasons, key=lambda reason: (-reason.level, reason.since_s)))
        level = ordered[0].level if ordered else TrustLevel.GOOD
        return type(self)(level, self.since_s if level == self.level else now_s, ordered)

    @property
    def word(self) -> str:
        """The level as it is reported."""
        return self.level.name.lower()

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the checks with a reason, ascending."""
        return tuple(sorted(reason.key for reason in self.reasons))

    def record(self) -> dict[str, Any]:
        """Plain data for records and messages."""
        reasons = [
            {"check": r.key, "level": r.level.name.lower(), "since_s": round(r.since_s, 3), "cause": r.cause}
            for r in self.reasons
        ]
        visibility_m = None if self.visibility_m is None else round(self.visibility_m)
        return {
            "level": self.word,
            "since_s": round(self.since_s, 3),
            "reasons": reasons,
            "visibility_m": visibility_m,
        }


TRUSTED = Trust()
