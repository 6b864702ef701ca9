"""Sweeps that did not arrive, by the stamps of those that did."""

from __future__ import annotations

from collections import deque
from statistics import fmean

REMEMBERED = 32
NEEDED = 8
"""Steps between stamps that are remembered, and that the period needs to be known."""
LONGEST_S = 2.0
"""Step beyond which the sensor was silent, or its clock was set."""


class MissingSweeps:
    """Counts the periods in which no sweep came."""

    def __init__(self) -> None:
        self._steps_s: deque[float] = deque(maxlen=REMEMBERED)
        self._last_s: float | None = None

    def before(self, stamp_s: float) -> int:
        """Sweeps missing between the sweep before and one of this stamp."""
        step_s = 0.0 if self._last_s is None else stamp_s - self._last_s
        self._last_s = stamp_s
        if not 0 < step_s < LONGEST_S:
            return 0
        self._steps_s.append(step_s)
        if len(self._steps_s) < NEEDED:
            return 0
        new = self._steps_s if len(self._steps_s) == NEEDED else (step_s,)
        period_s = self._period_s()
        return sum(max(round(step_s / period_s) - 1, 0) for step_s in new)

    def _period_s(self) -> float:
        """The mean of the steps that are no multiples, known though half of the sweeps are missing."""
        lower_s = sorted(self._steps_s)[len(self._steps_s) // 4]
        return fmean(step_s for step_s in self._steps_s if step_s < 1.5 * lower_s)
