"""The loop that drives the pipeline, at the sensor's period or as fast as it goes."""

from __future__ import annotations

import gc
import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from modt.pipeline import SINK, SOURCE, Pipeline
from modt.sinks.sink import LineSink, Sink
from modt.sources.stream import Stream
from modt.types import Budget, Frame, FrameResult

log = logging.getLogger(__name__)


class Pace(Protocol):
    """When the next frame may start."""

    def wait(self) -> None:
        """Return when it may be taken from its source."""
        ...

    def report(self) -> dict[str, Any]:
        """What was asked for and what was kept."""
        ...


class FullSpeed:
    """Frames as fast as they can be worked off."""

    def wait(self) -> None:
        """Return at once."""

    def report(self) -> dict[str, Any]:
        """Nothing was asked for."""
        return {"rate_hz": None}


@dataclass
class FixedPeriod:
    """Frames at absolute deadlines; after an overrun the deadlines start anew, so that no burst follows a stall.

    Attributes:
        period_s: time between frames [s].
        clock: monotonic time [s].
        sleep: waits for that many seconds.
        missed: deadlines that had passed before the frame could start.
        max_lateness_s: how late a frame started at worst [s].
    """

    period_s: float
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    missed: int = 0
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
        """The rate, deadlines missed, and the worst lateness [ms]."""
        return {
            "rate_hz": 1.0 / self.period_s,
            "missed_deadlines": self.missed,
            "max_lateness_ms": 1e3 * self.max_lateness_s,
        }


class Stop:
    """Set by SIGINT or SIGTERM: the frame in hand is finished, then the loop ends."""

    def __init__(self) -> None:
        self.signal: str | None = None

    @contextmanager
    def on_signals(self) -> Iterator[Stop]:
        """Listen meanwhile; a second signal ends the process the usual way."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        previous = {s: signal.signal(s, self._heard) for s in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield self
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def _heard(self, number: int, _frame: object) -> None:
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
    """Work through a stream; returns the number of frames done.

    Garbage is collected and frozen once at the start, so that no full collection falls into a frame.
    """
    run = pipeline.ledger.run
    frames = iter(stream)
    gc.collect()
    gc.freeze()
    done = 0
    while stop.signal is None:
        pace.wait()  # before the frame is taken, so that it gets the poses that came meanwhile
        frame: Frame | None = run(SOURCE, next, frames, None)
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
