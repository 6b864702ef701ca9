"""Deadlines of a live source: every frame has one period from its sweep to its result."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from modt.app.ladder import GIVEN_UP, Event, Ladder, Step, budget_at
from modt.pipeline import CLASSIFICATION
from modt.reporting.histogram import Histogram
from modt.types import Budget

DECAY = 0.95
"""Weight of the previous cost of the other stages at each frame. A greater cost is taken over at once."""
_BITS = 5
"""Leading bits held of a time [ns]: an error below 3 %, in at most 960 counts."""
log = logging.getLogger(__name__)


class Deadlines:
    """Decides which sweeps are processed and what their frames may spend. All times are monotonic [s].

    A sweep is released when it is complete, and its result is due a period later. The first frame warms up: it is due
    a period after its start, and sweeps that arrive before its end are left out.

    Args:
        period_s: period of the sensor.

    Attributes:
        ladder: the present step of load shedding.
        lateness, execution, latency: start less release, result less start, result less release [ns].
        missed: number of frames whose result was late.
        rest_ms: cost of a frame beside its classification: a maximum over the last frames that decays.
        changes: number of times that each step of the ladder was entered.
        shed: sweeps left out by the last step, or that arrived during the first frame.
        budget_ms: time for classification in the last frame.
    """

    def __init__(self, period_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.ladder, self.rest_ms = Ladder(), 0.0
        self.lateness, self.execution, self.latency = (Histogram(_BITS) for _ in range(3))
        self.missed = 0
        self.changes: Counter[str] = Counter()
        self.shed = 0
        self.budget_ms = 0.0
        self._period_s, self._clock = period_s, clock
        self._start_s = 0.0  # start of the present frame
        self._fresh_s: float | None = None  # end of the first frame
        self._shed_last = False

    @property
    def reduced(self) -> bool:
        """Whether the range of the sensor is cut."""
        return self.ladder.step >= Step.REDUCED

    def admit(self, arrived_s: float) -> bool:
        """Whether a sweep is processed."""
        self._shed_last = self.ladder.step is Step.DROPPED and not self._shed_last
        shed = self._shed_last or (self._fresh_s is not None and arrived_s < self._fresh_s)
        self.shed += shed
        return not shed

    def budget(self, whole: Budget, arrived_s: float, frame: int) -> Budget:
        """Budget of a frame that starts now, at most the `whole` budget of its profile."""
        self._start_s = self._clock()
        deadline_s = self._period_s + (self._start_s if self._fresh_s is None else arrived_s)
        left_ms = max(1e3 * (deadline_s - self._start_s) - self.rest_ms, 0.0)
        budget = budget_at(self.ladder.step, whole, left_ms, frame)
        self.budget_ms = min(ms for ms in (left_ms, budget.cpu_ms, budget.mean_ms) if ms is not None)
        return budget

    def finish(self, arrived_s: float, line: dict[str, Any]) -> None:
        """Judge the frame that ends now, by its ledger line."""
        ms = 1e-6 * sum(row["wall_ns"] for stage, row in line["stages"].items() if stage != CLASSIFICATION)
        self.rest_ms = max(ms, DECAY * self.rest_ms + (1 - DECAY) * ms)
        now_s = self._clock()
        if self._fresh_s is None:
            self._fresh_s = now_s
            return
        self.lateness.add(round(1e9 * (self._start_s - arrived_s)))
        self.execution.add(round(1e9 * (now_s - self._start_s)))
        self.latency.add(round(1e9 * (now_s - arrived_s)))
        share = (now_s - arrived_s) / self._period_s
        self.missed += share > 1.0
        self._changed(self.ladder.frame(now_s, share))

    def power(self, watts: float, limit_W: float) -> None:
        """Judge the power of a window of the meters."""
        self._changed(self.ladder.power(self._clock(), watts, limit_W))

    def report(self) -> dict[str, Any]:
        """Figures for the status, times in ms."""
        return {
            "frames": self.latency.count,
            "missed_deadlines": self.missed,
            "lateness_ms": _figures_ms(self.lateness),
            "execution_ms": _figures_ms(self.execution),
            "latency_ms": _figures_ms(self.latency),
            "budget_ms": round(self.budget_ms, 3),
            "other_stages_ms": round(self.rest_ms, 3),
            "step": self.ladder.step.name.lower(),
            "steps_entered": dict(self.changes),
            "shed_sweeps": self.shed,
        }

    def late_or_later(self) -> dict[str, list[float]]:
        """Lateness that occurred [ms], and the number of frames that were as late or later."""
        held = self.lateness.occurrences()
        ms = (1e-6 * np.array(held["values"])).round(4).tolist()
        return {"ms": ms, "frames": np.cumsum(held["counts"][::-1])[::-1].tolist()}

    def _changed(self, event: Event | None) -> None:
        if event is not None:
            self.changes[self.ladder.step.name.lower()] += 1
            log.warning("load: %s (%s)", GIVEN_UP[self.ladder.step], event.value)


class NoDeadlines:
    """Every frame of a replay is processed, and may spend the budget of its profile.

    Args:
        rate_hz: frames a second; None for no limit.
    """

    reduced = False

    def __init__(self, rate_hz: float | None) -> None:
        self._rate_hz = rate_hz

    def admit(self, arrived_s: float) -> bool:
        """True."""
        return True

    def budget(self, whole: Budget, arrived_s: float, frame: int) -> Budget:
        """The whole budget."""
        return whole

    def finish(self, arrived_s: float, line: dict[str, Any]) -> None:
        """No effect."""

    def power(self, watts: float, limit_W: float) -> None:
        """No effect."""

    def report(self) -> dict[str, Any]:
        """Rate of the frames."""
        return {"rate_hz": self._rate_hz}


def _figures_ms(times_ns: Histogram) -> dict[str, float]:
    return {name: round(ms, 3) for name, ms in times_ns.figures(1e6, p50=0.5, p99=0.99).items()}
