"""A thread that writes, so that the loop need not wait."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Generic, TypeVar

from modt.energy.ledger import LedgerLine
from modt.energy.windows import EnergyWindow
from modt.errors import ModtError
from modt.sinks.output import Health, LedgerSink, StatusSink, Writer

log = logging.getLogger(__name__)

T = TypeVar("T")
CLOSE_S = 0.6
"""Time limit for shutting a writer down [s]. Half of it is reserved for draining its queue."""
RETRY_S = 1.0
"""Pause after a failure [s]."""


class Background(Generic[T]):
    """Writes items in order in its own thread. A full queue drops its oldest item.

    A failure costs the item, which is counted; the next item is tried after a pause. The first failure in a row is
    logged, with a traceback if it is neither an OSError nor a ModtError.

    Args:
        name: subject of log messages.
        writer: used by the thread alone.
        depth: length of the queue.
        encode: converts an item, before it is queued, to what the writer takes. Its failures are counted, and raised.
        on_drop: called with each item that is dropped, as it is for the writer.
        retry_s: pause after a failure.
        close_s: time limit of `close`.
        clock: [s].
    """

    def __init__(
        self,
        name: str,
        writer: Writer[T],
        depth: int,
        *,
        encode: Callable[[Any], T] | None = None,
        on_drop: Callable[[T], None] = lambda item: None,
        retry_s: float = RETRY_S,
        close_s: float = CLOSE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self._writer = writer
        self._depth = depth
        self._encode = encode
        self._on_drop = on_drop
        self._retry_s = retry_s
        self._close_s = close_s
        self._clock = clock
        # The queue and the fields up to `_dropped` are guarded by `_changed`. The next two counts are the thread's.
        self._jobs: deque[tuple[Callable[[], None], Callable[[], None]]] = deque()  # each with what drops it
        self._changed = threading.Condition()
        self._end_s: float | None = None
        self._dropped = 0
        self._written = 0
        self._failed = 0
        self._unencoded = 0
        self._state = "ok"
        self._thread = threading.Thread(target=self._work, name="sink", daemon=True)
        self._thread.start()

    def write(self, item: Any, /) -> None:
        """Queue an item without waiting."""
        try:
            encoded: T = item if self._encode is None else self._encode(item)
        except Exception:
            self._unencoded += 1
            raise
        self._put(lambda: self._writer.write(encoded), lambda: self._on_drop(encoded))

    def ledger(self, line: LedgerLine | EnergyWindow, /) -> None:
        """Queue a line of the ledger, if the writer takes them."""
        writer = self._writer
        if isinstance(writer, LedgerSink):
            self._put(lambda: writer.ledger(line))

    def health(self) -> Health:
        """Items written, dropped, failed and waiting, the last failure, and the writer's own counts."""
        counts_of_writer: Health = getattr(self._writer, "health", dict)()
        return {
            **counts_of_writer,
            "written": self._written,
            "dropped": self._dropped,
            "failed": self._failed + self._unencoded,
            "waiting": len(self._jobs),
            "state": self._state,
        }

    def close(self) -> None:
        """Drain the queue and close the writer within the time limit. The rest is dropped."""
        with self._changed:
            if self._end_s is None:
                self._end_s = self._clock() + self._close_s / 2
            self._changed.notify()
        self._thread.join(self._close_s)
        with self._changed:
            while self._jobs:
                self._drop(self._jobs.popleft()[1])
        if self._thread.is_alive():
            log.warning("%s: does not end within %g s and is left alone", self.name, self._close_s)

    def _put(self, job: Callable[[], None], on_drop: Callable[[], None] = lambda: None) -> None:
        """Queue a job. A full queue drops its oldest one, a closed one the new one."""
        with self._changed:
            if self._end_s is not None:
                self._drop(on_drop)
                return
            if len(self._jobs) == self._depth:
                self._drop(self._jobs.popleft()[1])
            self._jobs.append((job, on_drop))
            self._changed.notify()

    def _drop(self, on_drop: Callable[[], None]) -> None:
        self._dropped += 1
        on_drop()

    def _work(self) -> None:
        """Run the jobs, then close the writer. This is the thread."""
        with suppress(OSError):
            # The thread inherits the priority of the loop, which alone runs in real time.
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        while (job := self._next()) is not None:
            self._attempt(job)
        with suppress(Exception):
            self._writer.close()

    def _attempt(self, job: Callable[[], None]) -> None:
        """Run a job in this thread, and count it by its outcome."""
        try:
            job()
        except Exception as error:
            self._fail(error)
            return
        self._written += 1
        if self._state != "ok":
            log.warning("%s: written again; %d failed, %d dropped so far", self.name, self._failed, self._dropped)
            self._state = "ok"

    def _next(self) -> Callable[[], None] | None:
        """Wait for the oldest job. None stands for the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._jobs or self._end_s is not None)
            late = self._end_s is not None and self._clock() > self._end_s
            return self._jobs.popleft()[0] if self._jobs and not late else None

    def _fail(self, error: Exception) -> None:
        """Count a failure, log the first in a row, and pause."""
        self._failed += 1
        known = isinstance(error, (ModtError, OSError))
        cause = f"{error}" if known else f"{type(error).__name__}: {error}"
        if self._state == "ok":
            log.warning(
                "%s: %s; tried again every %g s, what cannot be written is counted",
                self.name,
                cause,
                self._retry_s,
                exc_info=None if known else error,
            )
        self._state = cause
        with self._changed:
            self._changed.wait_for(lambda: self._end_s is not None, self._retry_s)


class StatusBackground(Background[T]):
    """Background of a writer that also shows the status of a service."""

    def status(self, words: str, metrics: str, /) -> None:
        """Queue a status."""
        writer = self._writer
        assert isinstance(writer, StatusSink)
        self._put(lambda: writer.status(words, metrics))
