"""Load shedding: the loop takes one step after the other under load, and takes them back when there is slack."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum, IntEnum

from modt.types import Budget

CALM_S = 0.5
"""Time with slack before one step is restored [s]."""
BUSY_SHARE, AMPLE_SHARE = 0.8, 0.5
"""Share of the period from arrival to result. Below BUSY_SHARE there is slack, below AMPLE_SHARE ample slack."""
NEAR_SHARE = 0.9
"""Share of the power limit, below which there is slack."""
PROBE_S = 3.0
"""A step down fails if a step up follows within this time [s]. The next step down then waits twice as long."""
MAX_PATIENCE_S = 30.0
"""Longest wait before a step down [s]."""
DEFERRED_EVERY = 5
"""While classification is deferred, one call is made every so many frames: the one that has waited longest."""


class Step(IntEnum):
    """Measures against load. Each step includes those before it."""

    ALL = 0  # no measure
    DEFERRED = 1  # classification is deferred, except one call every DEFERRED_EVERY frames
    REDUCED = 2  # distant points are left out
    DROPPED = 3  # every second sweep is left out


GIVEN_UP = {
    Step.ALL: "nothing is given up",
    Step.DEFERRED: "classification is deferred",
    Step.REDUCED: "distant points are left out",
    Step.DROPPED: "every second sweep is left out",
}


class Event(Enum):
    """Load that a frame or a window of the meters shows."""

    OVERRUN = "the result came after its deadline"
    OVER_POWER = "more power than the limit"
    SLACK = "slack"
    AMPLE = "ample slack"


class Ladder:
    """Present step, by the times of the frames and the power. All times are monotonic [s].

    `frame` and `power` return the event that has changed the step, None where it stays.
    """

    def __init__(self) -> None:
        self.step = Step.ALL
        self.patience_s = CALM_S
        self._cause = Event.OVERRUN  # cause of the last step up
        # start of slack, start of ample slack, time of the last step down
        self._calm_s = self._ample_s = self._down_s = float("-inf")

    def frame(self, now_s: float, share: float) -> Event | None:
        """A frame whose result came `share` of a period after its sweep."""
        if share > BUSY_SHARE:
            self._calm_s = now_s
        if share > AMPLE_SHARE:
            self._ample_s = now_s
        if share > 1.0:
            return self._fire(Event.OVERRUN, now_s)
        if self._cause is Event.OVERRUN and now_s - self._ample_s >= CALM_S:
            return self._fire(Event.AMPLE, now_s)
        if now_s - self._calm_s >= self.patience_s:
            return self._fire(Event.SLACK, now_s)
        return None

    def power(self, now_s: float, watts: float, limit_W: float) -> Event | None:
        """A window of the meters."""
        if watts <= NEAR_SHARE * limit_W:
            return None
        self._calm_s = self._ample_s = now_s
        return self._fire(Event.OVER_POWER, now_s) if watts > limit_W else None

    def _fire(self, event: Event, now_s: float) -> Event | None:
        """Change the step by one, at ample slack to the first; returns the event if that changes anything."""
        before = self.step
        change = {Event.AMPLE: -before, Event.SLACK: -1}.get(event, 1)
        self.step = Step(min(max(before + change, Step.ALL), Step.DROPPED))
        if self.step > before:
            failed = now_s - self._down_s < PROBE_S
            self.patience_s = min(2 * self.patience_s, MAX_PATIENCE_S) if failed else CALM_S
            self._cause, self._calm_s, self._ample_s = event, now_s, now_s
        elif self.step < before:
            self._down_s = self._calm_s = now_s  # the time with ample slack is not reset
        return event if self.step != before else None


def budget_at(step: Step, budget: Budget, left_ms: float, frame: int) -> Budget:
    """Budget of a frame at a step, from the budget of the profile and the time left to the deadline [ms]."""
    if step >= Step.DEFERRED:
        calls = 1 if frame % DEFERRED_EVERY == 0 else 0
        return replace(budget, calls=calls if budget.calls is None else min(calls, budget.calls))
    return replace(budget, cpu_ms=left_ms if budget.cpu_ms is None else min(budget.cpu_ms, left_ms))
