"""Deadlines of a live source: every frame has one period from its sweep to its result."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from modt.app.load_shedding import GIVEN_UP, LoadEvent, LoadShedding, Step, budget_at
from modt.energy.ledger import LedgerLine
from modt.pipeline import CLASSIFICATION
from modt.reporting.histogram import Histogram
from modt.types import Budget

DECAY = 0.95
"""Weight of the previous cost of the other stages at each frame. A greater cost is taken over at once."""
_BITS = 5
"""Leading bits held of a time [ns]: an error below 3 %, in at most 960 counts."""
log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class DeadlineFigures:
    """Figures of the deadlines for status and summary. Times have their mean, p50, p99 and max."""

    frames: int
    missed_deadlines: int  # frames whose result was late
    lateness_ms: Mapping[str, float]  # from the sweep to the start of its frame
    execution_ms: Mapping[str, float]  # from the start of a frame to its result
    latency_ms: Mapping[str, float]  # from the sweep to its result
    budget_ms: float  # time for classification in the last frame
    other_stages_ms: float  # cost of a frame beside its classification
    step: str  # of load shedding
    steps_entered: Mapping[str, int]
    shed_sweeps: int  # sweeps left out by the last step, during the first frame, or after a signal to stop


class Deadlines:
    """Decides which sweeps are processed and what their frames may spend. All times are monotonic [s].

    A sweep is released when it is complete, and its result is due a period later. The first frame warms up: it is due
    a period after its start, and sweeps that arrive before its end are left out.

    Args:
        period_s: period of the sensor.

    Attributes:
        shedding: the load shedding with its present step.
        missed: number of frames whose result was late.
        changes: number of times that each step was entered.
        shed: number of sweeps left out.
        lateness_ns: times from a sweep to the start of its frame.
    """

    def __init__(self, period_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.shedding = LoadShedding()
        self.missed = 0
        self.shed = 0
        self.changes: Counter[str] = Counter()
        self._period_s = period_s
        self._clock = clock
        self.lateness_ns = Histogram(_BITS)
        self._execution_ns = Histogram(_BITS)
        self._latency_ns = Histogram(_BITS)
        self._budget_ms = 0.0
        self._rest_ms = 0.0  # cost of a frame beside its classification: a maximum over the last frames that decays
        self._start_s = 0.0  # start of the present frame
        self._warm_s: float | None = None  # end of the first frame
        self._shed_last = False

    def follow(self, period_s: float) -> None:
        """Take another period of the sensor [s]."""
        self._period_s = period_s

    @property
    def reduced(self) -> bool:
        """Whether the range of the sensor is cut."""
        return self.shedding.step >= Step.REDUCED

    def admit(self, arrived_s: float) -> bool:
        """Whether a sweep is processed."""
        self._shed_last = self.shedding.step is Step.DROPPED and not self._shed_last
        shed = self._shed_last or (self._warm_s is not None and arrived_s < self._warm_s)
        self.shed += shed
        return not shed

    def leave_out(self) -> None:
        """Count a sweep that came together with a signal to stop."""
        self.shed += 1

    def budget(self, whole: Budget, arrived_s: float, frame: int) -> Budget:
        """Budget of a frame that starts now, at most the `whole` budget of its profile."""
        self._start_s = self._clock()
        deadline_s = self._period_s + (self._start_s if self._warm_s is None else arrived_s)
        left_ms = max(1e3 * (deadline_s - self._start_s) - self._rest_ms, 0.0)
        budget = budget_at(self.shedding.step, whole, left_ms, frame)
        self._budget_ms = min(ms for ms in (left_ms, budget.cpu_ms, budget.mean_ms) if ms is not None)
        return budget

    def finish(self, arrived_s: float, line: LedgerLine) -> None:
        """Judge the frame that ends now, by its ledger line."""
        rest_ns = sum(work.wall_ns for stage, work in line.stages.items() if stage != CLASSIFICATION)
        rest_ms = 1e-6 * rest_ns
        self._rest_ms = max(rest_ms, DECAY * self._rest_ms + (1 - DECAY) * rest_ms)
        now_s = self._clock()
        if self._warm_s is None:
            self._warm_s = now_s
            return
        self.lateness_ns.add(round(1e9 * (self._start_s - arrived_s)))
        self._execution_ns.add(round(1e9 * (now_s - self._start_s)))
        self._latency_ns.add(round(1e9 * (now_s - arrived_s)))
        share = (now_s - arrived_s) / self._period_s
        self.missed += share > 1.0
        self._log_change(self.shedding.frame(now_s, share))

    def power(self, watts: float, limit_W: float) -> None:
        """Judge the power of a window of the meters."""
        self._log_change(self.shedding.power(self._clock(), watts, limit_W))

    def figures(self) -> DeadlineFigures:
        """Figures so far."""
        return DeadlineFigures(
            frames=self._latency_ns.count,
            missed_deadlines=self.missed,
            lateness_ms=_times_ms(self.lateness_ns),
            execution_ms=_times_ms(self._execution_ns),
            latency_ms=_times_ms(self._latency_ns),
            budget_ms=round(self._budget_ms, 3),
            other_stages_ms=round(self._rest_ms, 3),
            step=self.shedding.step.name.lower(),
            steps_entered=dict(self.changes),
            shed_sweeps=self.shed,
        )

    def late_or_later(self) -> dict[str, list[float]]:
        """Lateness that occurred [ms], and the number of frames that were as late or later."""
        held = self.lateness_ns.occurrences()
        ms = (1e-6 * np.array(held["values"])).round(4).tolist()
        return {"ms": ms, "frames": np.cumsum(held["counts"][::-1])[::-1].tolist()}

    def _log_change(self, event: LoadEvent | None) -> None:
        if event is not None:
            self.changes[self.shedding.step.name.lower()] += 1
            log.warning("load: %s (%s)", GIVEN_UP[self.shedding.step], event.value)


class NoDeadlines:
    """Every frame of a replay is processed, and may spend the budget of its profile."""

    reduced = False

    def admit(self, arrived_s: float) -> bool:
        """True."""
        return True

    def leave_out(self) -> None:
        """No effect."""

    def budget(self, whole: Budget, arrived_s: float, frame: int) -> Budget:
        """The whole budget."""
        return whole

    def finish(self, arrived_s: float, line: LedgerLine) -> None:
        """No effect."""

    def power(self, watts: float, limit_W: float) -> None:
        """No effect."""


def _times_ms(times_ns: Histogram) -> dict[str, float]:
    return {name: round(ms, 3) for name, ms in times_ns.figures(1e6, p50=0.5, p99=0.99).items()}
