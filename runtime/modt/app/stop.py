"""Signals that end a run or ask for a reload."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

STOPPING = (signal.SIGINT, signal.SIGTERM)
"""Signals that end a run."""
NAP_S = 0.05
"""Longest sleep without a check of the signals [s]."""
SAME_S = 1.0
"""Signals within this time of the first one are the same request [s]: `timeout` signals its child and then its group,
and a launcher passes on a Ctrl-C that the terminal has sent to its child too."""


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
        self.signal: str | None = None  # name of the one that ends the run
        self._asked_s: float | None = None  # time of the first signal to stop
        self._reload = False
        self._sleep = sleep
        self._clock = clock
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
        asked = self._reload
        self._reload = False
        return asked

    @contextmanager
    def on_signals(self) -> Iterator[Stop]:
        """Handle the signals within the context; a second one to stop, after SAME_S, ends the process."""
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
        now_s = self._clock()
        if self._asked_s is None:
            self._asked_s = now_s
            self.signal = signal.Signals(number).name
        elif now_s - self._asked_s >= SAME_S:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.raise_signal(number)

    def _on_reload(self, _number: int, _frame: object) -> None:
        self._reload = True
