"""A recording as a source of frames: every one of them, at full speed or at a rate."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from modt.energy.ledger import Ledger
from modt.pipeline import SOURCE
from modt.sources.stream import Received, Stream, StreamEndedError


class Playback:
    """The frames of a stream. Reading a frame is a span of the ledger.

    At a rate, frames begin at absolute deadlines, which restart after an overrun so that no burst follows.

    Args:
        rate_hz: frames a second; None for no limit.
    """

    def __init__(
        self,
        stream: Stream,
        ledger: Ledger,
        rate_hz: float | None = None,
        sleep: Callable[[float], None] = time.sleep,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.info, self.faults, self.profile = stream.info, stream.faults, stream.info.profile
        self._frames, self._ledger = iter(stream), ledger
        self._rate_hz, self._clock, self._sleep = rate_hz, clock, sleep
        self._max_lateness_s = self._lost_s = 0.0  # largest delay, and time by which deadlines were put off
        self._deadline_s: float | None = None

    def start(self) -> None:
        """No effect."""

    def take(self, timeout_s: float) -> Received:
        """The next frame, without a time limit.

        Raises:
            StreamEndedError: there is none.
        """
        if self._rate_hz is not None:
            self._wait(1.0 / self._rate_hz)  # before the frame is read, so that poses received meanwhile apply to it
        frame = self._ledger.run(SOURCE, next, self._frames, None)
        if frame is None:
            raise StreamEndedError
        return Received(frame, 0.0)

    def health(self) -> dict[str, Any]:
        """No counts: nothing is received."""
        return {}

    def report(self) -> dict[str, Any]:
        """Rate, periods without a frame, and largest delay [ms]."""
        if self._rate_hz is None:
            return {"rate_hz": None}
        return {
            "rate_hz": self._rate_hz,
            "missed_deadlines": int(self._lost_s * self._rate_hz + 1e-6),
            "max_lateness_ms": 1e3 * self._max_lateness_s,
        }

    def close(self) -> None:
        """No effect."""

    def _wait(self, period_s: float) -> None:
        """Sleep until the deadline. After a delay of more than a period the deadlines start anew."""
        now_s = self._clock()
        if self._deadline_s is None:
            self._deadline_s = now_s
        if now_s < self._deadline_s:
            self._sleep(self._deadline_s - now_s)
            now_s = self._clock()
        late_s = now_s - self._deadline_s
        self._max_lateness_s = max(self._max_lateness_s, late_s)
        if late_s > period_s:
            self._lost_s += late_s
            self._deadline_s = now_s
        self._deadline_s += period_s
