"""Load shedding: under load the loop gives up one thing after the other, and takes them back when there is slack."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum, IntEnum

from modt.types import Budget

CALM_S = 0.5
"""Time with slack before one step is restored [s]."""
BUSY_SHARE = 0.8
"""Share of the period from arrival to result below which there is slack."""
AMPLE_SHARE = 0.5
"""Share of the period from arrival to result below which there is ample slack."""
NEAR_SHARE = 0.9
"""Share of the power limit below which there is slack."""
PROBE_S = 3.0
"""A step down fails if a step up follows within this time [s]. The next step down then waits twice as long."""
MAX_PATIENCE_S = 30.0
"""Longest wait before a step down [s]."""
DEFERRED_EVERY = 5
"""While classification is deferred, one call is made every so many frames: the one of greatest worth."""


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


class LoadEvent(Enum):
    """Load that a frame or a window of the meters shows."""

    OVERRUN = "the result came after its deadline"
    OVER_POWER = "more power than the limit"
    SLACK = "slack"
    AMPLE = "ample slack"


class LoadShedding:
    """Chooses the step by the times of the frames and the power. All times are monotonic [s].

    `frame` and `power` return the event that has changed the step, None where it stays.
    """

    def __init__(self) -> None:
        self.step = Step.ALL
        self.patience_s = CALM_S  # time with slack before the next step down
        self._cause = LoadEvent.OVERRUN  # cause of the last step up
        self._slack_since_s = float("-inf")
        self._ample_since_s = float("-inf")
        self._stepped_down_s = float("-inf")

    def frame(self, now_s: float, share: float) -> LoadEvent | None:
        """Judge a frame whose result came `share` of a period after its sweep."""
        if share > BUSY_SHARE:
            self._slack_since_s = now_s
        if share > AMPLE_SHARE:
            self._ample_since_s = now_s
        if share > 1.0:
            return self._apply(LoadEvent.OVERRUN, now_s)
        # Slack in time says nothing about power: after too much power the steps are taken back one by one.
        if self._cause is LoadEvent.OVERRUN and now_s - self._ample_since_s >= CALM_S:
            return self._apply(LoadEvent.AMPLE, now_s)
        if now_s - self._slack_since_s >= self.patience_s:
            return self._apply(LoadEvent.SLACK, now_s)
        return None

    def power(self, now_s: float, watts: float, limit_W: float) -> LoadEvent | None:
        """Judge a window of the meters."""
        if watts <= NEAR_SHARE * limit_W:
            return None
        self._slack_since_s = now_s
        self._ample_since_s = now_s
        return self._apply(LoadEvent.OVER_POWER, now_s) if watts > limit_W else None

    def _apply(self, event: LoadEvent, now_s: float) -> LoadEvent | None:
        """Step up on overload, down on slack; ample slack returns to ALL.

        Returns:
            The event if it changes the step, else None.
        """
        before = self.step
        change = {LoadEvent.AMPLE: -before, LoadEvent.SLACK: -1}.get(event, 1)
        self.step = Step(min(max(before + change, Step.ALL), Step.DROPPED))
        if self.step > before:
            failed = now_s - self._stepped_down_s < PROBE_S
            self.patience_s = min(2 * self.patience_s, MAX_PATIENCE_S) if failed else CALM_S
            self._cause = event
            self._slack_since_s = now_s
            self._ample_since_s = now_s
        elif self.step < before:
            # The time with ample slack goes on, so that all is restored as soon as it has lasted long enough.
            self._stepped_down_s = now_s
            self._slack_since_s = now_s
        return event if self.step != before else None


def budget_at(step: Step, budget: Budget, left_ms: float, frame: int) -> Budget:
    """Budget of a frame at a step, from the budget of the profile and the time left to the deadline [ms].

    The time left does not limit the few calls of deferred classification, which would else never be made.
    """
    if step >= Step.DEFERRED:
        calls = 1 if frame % DEFERRED_EVERY == 0 else 0
        return replace(budget, calls=calls if budget.calls is None else min(calls, budget.calls))
    return replace(budget, cpu_ms=left_ms if budget.cpu_ms is None else min(budget.cpu_ms, left_ms))
