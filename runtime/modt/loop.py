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
    missed: int = 0  # deadlines that passed before their frame started
    max_lateness_s: float = 0.0
    _deadline_s: float | None = None

    def wait(self) -> None:
        """Sleep until the deadline, or count it as missed."""
        now = self.clock()
        if self._deadline_s is None:
            self._deadline_s = now
        if now < self._deadline_s:
            self.sleep(self._deadline_s - now)
            now = self.clock()
        late_s = now - self._deadline_s
        self.max_lateness_s = max(self.max_lateness_s, late_s)
        if late_s > self.period_s:
            self.missed += int(late_s / self.period_s)
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
    """Stop request by SIGINT or SIGTERM: the loop ends after the current frame."""

    def __init__(self) -> None:
        self.signal: str | None = None

    @contextmanager
    def on_signals(self) -> Iterator[Stop]:
        """Handle the signals within the context; a second signal ends the process."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        previous = {s: signal.signal(s, self._on_signal) for s in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield self
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def _on_signal(self, number: int, _frame: object) -> None:
        self.signal = signal.Signals(number).name
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


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
