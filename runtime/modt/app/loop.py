"""The loop that drives the pipeline, at a fixed rate or at full speed."""

from __future__ import annotations

import gc
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from modt.pipeline import SINK, SOURCE, Pipeline
from modt.sinks.output import LineSink, Sink
from modt.sources.stream import Stream
from modt.types import Budget, FrameResult

STOPPING = (signal.SIGINT, signal.SIGTERM)
NAP_S = 0.05
"""Longest sleep without a look at the signals."""


class FullSpeed:
    """Frames without waiting."""

    def wait(self) -> None:
        """Return at once."""

    def report(self) -> dict[str, Any]:
        """No rate was requested."""
        return {"rate_hz": None}


@dataclass
class FixedPeriod:
    """Frames at absolute deadlines, which restart after an overrun so that no burst follows."""

    period_s: float
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    max_lateness_s: float = 0.0
    lost_s: float = 0.0  # by which the deadlines were put off
    _deadline_s: float | None = None

    @property
    def missed(self) -> int:
        """Periods without a frame."""
        return int(self.lost_s / self.period_s + 1e-6)

    def wait(self) -> None:
        """Sleep until the deadline; when late by more than a period, begin a new row of deadlines."""
        now = self.clock()
        if self._deadline_s is None:
            self._deadline_s = now
        if now < self._deadline_s:
            self.sleep(self._deadline_s - now)
            now = self.clock()
        late_s = now - self._deadline_s
        self.max_lateness_s = max(self.max_lateness_s, late_s)
        if late_s > self.period_s:
            self.lost_s += late_s
            self._deadline_s = now
        self._deadline_s += self.period_s

    def report(self) -> dict[str, Any]:
        """Rate, deadlines missed, and largest delay [ms]."""
        return {
            "rate_hz": 1.0 / self.period_s,
            "missed_deadlines": self.missed,
            "max_lateness_ms": 1e3 * self.max_lateness_s,
        }


Pace = FullSpeed | FixedPeriod


class Stop:
    """Requests by signals: SIGINT and SIGTERM end the loop after the current frame, SIGHUP asks for a reload."""

    def __init__(
        self, sleep: Callable[[float], None] = time.sleep, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.signal: str | None = None
        self._reload, self._sleep, self._clock = False, sleep, clock

    def sleep(self, seconds: float) -> None:
        """Sleep, in naps: a signal does not end one, and is seen after it."""
        end_s = self._clock() + seconds
        while self.signal is None and (left_s := end_s - self._clock()) > 0:
            self._sleep(min(left_s, NAP_S))

    def take_reload(self) -> bool:
        """Whether a reload has been asked for since the last call."""
        asked, self._reload = self._reload, False
        return asked

    @contextmanager
    def on_signals(self, *, reload: bool = False) -> Iterator[Stop]:
        """Handle the signals within the context, SIGHUP where `reload`; a second one to stop ends the process."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        handlers: dict[signal.Signals, Callable[[int, object], None]] = dict.fromkeys(STOPPING, self._on_stop)
        if reload:
            handlers[signal.SIGHUP] = self._on_reload
        previous = {number: signal.signal(number, handler) for number, handler in handlers.items()}
        try:
            yield self
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def _on_stop(self, number: int, _frame: object) -> None:
        self.signal = signal.Signals(number).name
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def _on_reload(self, _number: int, _frame: object) -> None:
        self._reload = True


Observer = Callable[[FrameResult, dict[str, Any]], None]
"""Called with every result and its ledger line."""


def drive(
    stream: Stream,
    pipeline: Pipeline,
    sinks: Sequence[Sink],
    ledger_lines: LineSink,
    budget: Budget,
    pace: Pace,
    stop: Stop,
    observe: Observer,
) -> int:
    """Process a stream; returns the number of frames.

    Garbage is collected and frozen once at the start, so that no full collection falls into a frame.
    """
    run = pipeline.ledger.run
    frames = iter(stream)
    gc.collect()
    gc.freeze()
    done = 0
    while stop.signal is None:
        pace.wait()  # before the frame is taken, so that poses received meanwhile apply to it
        if stop.signal is not None:
            break
        frame = run(SOURCE, next, frames, None)
        if frame is None:
            break
        result = pipeline.step(frame, budget)
        for sink in sinks:
            run(SINK, sink.write, result)
        line = pipeline.ledger.close_frame(frame.index)
        ledger_lines.write(line)
        observe(result, line)
        done += 1
    return done
