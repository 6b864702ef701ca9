"""The loop over the frames of a source, live or recorded, and the signals that end it."""

from __future__ import annotations

import gc
import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from typing import TYPE_CHECKING

from modt.app.containment import RENEW_AFTER, Containment
from modt.app.deadlines import Deadlines, NoDeadlines
from modt.app.playback import Playback
from modt.app.stages import Stages
from modt.app.supervisor import Supervisor
from modt.energy.ledger import Line
from modt.errors import ModtError
from modt.pipeline import SINK
from modt.sinks.output import Writer
from modt.sources.stream import Received, StreamEndedError
from modt.types import FrameResult

if TYPE_CHECKING:
    from modt.sources.live.live_stream import LiveStream

log = logging.getLogger(__name__)

STOPPING = (signal.SIGINT, signal.SIGTERM)
NAP_S = 0.05
"""Longest sleep without a check of the signals [s]."""
WAIT_S = 0.2
"""Longest wait for a sweep without a check of the signals and the watchdog [s]."""
REPORT_S = 1.0
"""Time between two reports of the status [s]."""


class Stop:
    """Requests by signals: SIGINT and SIGTERM end the loop after the current frame, SIGHUP asks for a reload."""

    def __init__(
        self,
        sleep: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.monotonic,
        *,
        reload: bool = False,
    ) -> None:
        """`reload`: whether SIGHUP is handled."""
        self.signal: str | None = None
        self._reload, self._sleep, self._clock = False, sleep, clock
        self._handlers: dict[signal.Signals, Callable[[int, object], None]] = dict.fromkeys(STOPPING, self._on_stop)
        if reload:
            self._handlers[signal.SIGHUP] = self._on_reload

    def sleep(self, seconds: float) -> None:
        """Sleep in short naps. A signal does not interrupt a nap, and is noticed after it."""
        end_s = self._clock() + seconds
        while self.signal is None and (left_s := end_s - self._clock()) > 0:
            self._sleep(min(left_s, NAP_S))

    def take_reload(self) -> bool:
        """Whether a reload has been asked for since the last call."""
        asked, self._reload = self._reload, False
        return asked

    @contextmanager
    def on_signals(self) -> Iterator[Stop]:
        """Handle the signals within the context; a second one to stop ends the process."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        previous = {number: signal.signal(number, handler) for number, handler in self._handlers.items()}
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


class Loop:
    """Drives the stages by the frames of a source.

    Args:
        source: source of the frames.
        stages: process them.
        sinks: sinks of the results, by their names in messages.
        observe: called with every result and its ledger line.
        report: called once a second.
        deadlines, failures, stop: decide which sweeps are processed, which failures are contained, and when to end.

    Attributes:
        reloads, refused_reloads: counts.
    """

    def __init__(
        self,
        source: LiveStream | Playback,
        stages: Stages,
        sinks: Mapping[str, Writer[FrameResult]],
        observe: Callable[[FrameResult, Line], None],
        report: Callable[[Supervisor], None],
        deadlines: Deadlines | NoDeadlines,
        failures: Containment,
        stop: Stop,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source, self._stages, self._sinks = source, stages, sinks
        self._observe, self._report = observe, report
        self._deadlines, self._failures, self._stop, self._clock = deadlines, failures, stop, clock
        self.reloads = self.refused_reloads = 0

    def run(self, supervisor: Supervisor) -> None:
        """Process frames until a signal, or the end of the source. The first one identifies the sensor.

        Garbage is collected and frozen once at the start, so that no full collection falls into a frame.

        Raises:
            ModtError: a failure that cannot be contained.
        """
        gc.collect()
        gc.freeze()
        supervisor.ready()
        frames = self._frames(supervisor)
        first = next(frames, None)
        if first is not None:
            self._stages.recognise(first.frame, self._source.profile)
            for received in chain([first], frames):
                self._process(received)

    def _frames(self, supervisor: Supervisor) -> Iterator[Received]:
        """Frames as they arrive. Reloads, watchdog and reports are served between them."""
        reported_s = float("-inf")
        while self._stop.signal is None:
            if self._stop.take_reload():
                self._reload(supervisor)
            try:
                received = self._source.take(WAIT_S)
            except StreamEndedError:
                return
            except ModtError:
                raise
            except Exception as error:
                self._failures.fail(error, "source")
                received = None
            if received is not None and self._stop.signal is None:
                yield received
            supervisor.alive()
            if self._clock() - reported_s >= REPORT_S:
                reported_s = self._clock()
                self._failures.spare("status", self._report, supervisor)

    def _process(self, received: Received) -> None:
        if not self._deadlines.admit(received.arrived_s):
            return
        try:
            line = self._step(received)
        except ModtError:
            raise
        except Exception as error:
            self._stages.ledger.close_frame(received.frame.index)
            self._failures.fail(error, "frame")
            self._stages.recover(anew=self._failures.in_a_row == RENEW_AFTER)
            return
        self._failures.succeed()
        self._deadlines.finish(received.arrived_s, line)
        self._stages.watch(received.frame)

    def _step(self, received: Received) -> Line:
        """Process a frame; returns its ledger line."""
        stages, frame = self._stages, received.frame
        budget = self._deadlines.budget(stages.budget, received.arrived_s, frame.index)
        result = stages.step(frame, budget, reduced=self._deadlines.reduced)
        for name, sink in self._sinks.items():
            self._failures.spare(name, stages.ledger.run, SINK, sink.write, result)
        line = stages.ledger.close_frame(frame.index)
        self._failures.spare("records", self._observe, result, line)
        return line

    def _reload(self, supervisor: Supervisor) -> None:
        supervisor.reloading()
        try:
            self._stages.reload()
        except ModtError as error:
            self.refused_reloads += 1
            log.error("%s; the profile before stays in use", error)
        else:
            self.reloads += 1
            log.warning("profile loaded again")
        supervisor.ready()
