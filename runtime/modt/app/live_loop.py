"""The loop over a live source: newest sweep first, on time or with less, never ended by a single frame."""

from __future__ import annotations

import gc
import logging
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from modt.app.containment import RENEW_AFTER, Containment
from modt.app.ladder import GIVEN_UP, Change, Ladder, Step, budget_at
from modt.app.loop import Stop
from modt.app.supervisor import Supervisor
from modt.app.timing import RestCost, Timing
from modt.errors import ModtError
from modt.pipeline import SINK
from modt.sinks.output import Sink
from modt.sources.live.live_stream import Received
from modt.sources.live.sweep_reader import StreamEndedError
from modt.types import Budget, Frame, FrameResult

log = logging.getLogger(__name__)

WAIT_S = 0.2
"""Longest wait for a sweep without a look at the signals and the watchdog."""
REPORT_S = 1.0
"""Between two reports of the status."""


class Source(Protocol):
    """Where sweeps come from: modt.sources.live.live_stream.LiveStream."""

    def take(self, timeout_s: float) -> Received | None:
        """The newest sweep, None without one."""


class Stages(Protocol):
    """The stages of a profile, which may be exchanged between two frames."""

    @property
    def period_s(self) -> float:
        """Of the sensor."""

    @property
    def budget(self) -> Budget:
        """Of the profile."""

    def step(self, frame: Frame, budget: Budget, *, reduced: bool) -> FrameResult:
        """One frame; reduced: without what is far."""

    def run_sink(self, stage: str, sink: Sink, result: FrameResult) -> None:
        """Write a result, as a span of the ledger."""

    def close_frame(self, index: int) -> dict[str, Any]:
        """The ledger line of a frame."""

    def recover(self, *, anew: bool) -> None:
        """Stand again as after the last good frame, or begin anew."""

    def reload(self) -> None:
        """Take the profile as it is on disk now; raises ModtError and changes nothing if it is not valid."""


@dataclass(frozen=True, slots=True)
class NamedSink:
    """A sink, and what it is called in messages."""

    name: str
    sink: Sink


Observer = Callable[[FrameResult, dict[str, Any]], None]


class LiveLoop:
    """Drives the stages by the sweeps of a source.

    Attributes:
        ladder, timing, failures, rest: what is known of the frames so far.
        changes: number of times that each step of the ladder was entered.
        shed: sweeps left out by the last step, or that came during the first frame.
        budget_ms: of the last frame, for classification.
        reloads, refused_reloads: counts.
    """

    def __init__(
        self,
        source: Source,
        stages: Stages,
        sinks: Sequence[NamedSink],
        observe: Observer,
        report: Callable[[], None],
        ladder: Ladder,
        stop: Stop,
        supervisor: Supervisor,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source, self._stages, self._sinks = source, stages, sinks
        self._observe, self._report = observe, report
        self.ladder, self._stop, self._supervisor, self._clock = ladder, stop, supervisor, clock
        self.timing, self.rest, self.failures = Timing(), RestCost(), Containment()
        self.changes: Counter[str] = Counter()
        self.shed = self.reloads = self.refused_reloads = self.frames = 0
        self.budget_ms = 0.0
        self._shed_last = False
        self._fresh_s = float("-inf")  # sweeps that arrived before are left out
        self._reported_s = float("-inf")

    def run(self) -> None:
        """Until a signal, or the end of the source.

        Raises:
            ModtError: a failure that repeats.
        """
        gc.collect()
        gc.freeze()
        self._supervisor.ready()
        while self._stop.signal is None:
            if self._stop.take_reload():
                self._reload()
            try:
                received = self._source.take(WAIT_S)
            except StreamEndedError:
                break
            except ModtError:
                raise
            except Exception as error:
                cause = f"nothing can be received any more ({type(error).__name__}: {error})"
                raise ModtError("source", cause, "check its network interface and start again") from error
            if received is not None:
                self._sweep(received)
            self._supervisor.alive()
            if self._clock() - self._reported_s >= REPORT_S:
                self._reported_s = self._clock()
                self._spare("status", self._report)

    def _sweep(self, received: Received) -> None:
        self._shed_last = self.ladder.step is Step.DROPPED and not self._shed_last
        if self._shed_last or received.arrived_s < self._fresh_s:
            self.shed += 1
            return
        start_s, period_s = self._clock(), self._stages.period_s
        try:
            self._frame(received, start_s + period_s if not self.frames else received.arrived_s + period_s)
        except ModtError:
            raise
        except Exception as error:
            self._stages.close_frame(received.frame.index)
            self.failures.fail(error, "frame")
            self._stages.recover(anew=self.failures.in_a_row == RENEW_AFTER)
            return
        self.failures.succeed()
        finish_s, self.frames = self._clock(), self.frames + 1
        if self.frames > 1:
            share = self.timing.add(received.arrived_s, start_s, finish_s, period_s)
            self._changed(self.ladder.frame(finish_s, share))
        else:  # it takes long, choosing the profile: what came meanwhile would be late
            self._fresh_s = finish_s

    def _frame(self, received: Received, deadline_s: float) -> None:
        step = self.ladder.step
        left_ms = max(1e3 * (deadline_s - self._clock()) - self.rest.ms, 0.0)
        budget = budget_at(step, self._stages.budget, left_ms, received.frame.index)
        self.budget_ms = min(ms for ms in (left_ms, budget.cpu_ms, budget.mean_ms) if ms is not None)
        result = self._stages.step(received.frame, budget, reduced=step >= Step.REDUCED)
        for named in self._sinks:
            self._spare(named.name, self._stages.run_sink, SINK, named.sink, result)
        line = self._stages.close_frame(result.frame.index)
        self.rest.add(line)
        self._spare("records", self._observe, result, line)

    def _spare(self, where: str, call: Callable[..., None], *arguments: Any) -> None:
        """Call what a frame can do without."""
        try:
            call(*arguments)
        except Exception as error:
            self.failures.note(error, where)

    def power(self, watts: float) -> None:
        """Tell the ladder of a window of the meters."""
        self._changed(self.ladder.power(self._clock(), watts))

    def _changed(self, change: Change | None) -> None:
        if change is not None:
            self.changes[change.after.name.lower()] += 1
            log.warning("load: %s (%s)", GIVEN_UP[change.after], change.event.value)

    def _reload(self) -> None:
        self._supervisor.reloading()
        try:
            self._stages.reload()
        except ModtError as error:
            self.refused_reloads += 1
            log.error("%s; the profile before stays in use", error)
        else:
            self.reloads += 1
            log.warning("profile loaded again")
        self._supervisor.ready()
