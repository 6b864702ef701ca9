"""Doubt about the stamps of a source, by when its messages arrived."""

from __future__ import annotations

STEP_S = 1.0
"""Time by which a stamp may run ahead of the arrivals [s]; beyond it, or before the last stamp, it is doubted."""
DOUBT_S = 0.5
"""Time for which doubtful stamps are refused [s]. If they keep coming, a clock was set, and they are followed."""
FIRST_STEP_S = 0.1
"""Time between two messages until two are believed [s]."""
CLOCK_SET = "a clock was set: stamps go on evenly"
"""Fault of a frame from which on other stamps are followed."""


class StampCheck:
    """Refuses single stamps that lie and follows a clock that was set.

    Attributes:
        steps: number of times that a clock was set.
        shift_s: time to add to a stamp, so that stamps go on evenly where a clock was set [s].
    """

    def __init__(self, last: tuple[float, float] | None = None) -> None:
        """`last`: stamp and arrival of a message that is believed."""
        self.steps, self.shift_s = 0, 0.0
        self._last, self._before_s = last, last[1] if last else 0.0
        self._step_s = FIRST_STEP_S
        self._doubted_s: float | None = None  # time since the first doubtful stamp

    def doubt(self, stamp_s: float, arrived_s: float) -> str:
        """Why a stamp is refused; empty if it is believed. The clock of the arrivals may be set as well."""
        since_s, self._before_s = arrived_s - self._before_s, arrived_s
        if self._last is None:
            self._last = stamp_s, arrived_s
            return ""
        passed_s, waited_s = stamp_s - self._last[0], arrived_s - self._last[1]
        if 0 <= passed_s <= max(waited_s, 0.0) + STEP_S:
            self._step_s = passed_s or self._step_s
        else:
            since_s = since_s if since_s > 0 else self._step_s
            self._doubted_s = 0.0 if self._doubted_s is None else self._doubted_s + since_s
            both_set = waited_s < 0 and abs(passed_s - waited_s) <= STEP_S
            if self._doubted_s < DOUBT_S and not both_set:
                return f"stamped {abs(passed_s):.3f} s {'before' if passed_s < 0 else 'after'} the last sweep"
            self.steps += 1
            self.shift_s += max(waited_s, self._step_s) - passed_s
        self._last, self._doubted_s = (stamp_s, arrived_s), None
        return ""
