"""A recording as a source of frames: every one of them, at a pace."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from modt.energy.ledger import Ledger
from modt.pipeline import SOURCE
from modt.sources.live.sweep_reader import Received, StreamEndedError
from modt.sources.stream import Stream


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


class Playback:
    """The frames of a stream, taken at a pace; reading them is a span of the ledger."""

    def __init__(self, stream: Stream, pace: Pace, ledger: Ledger) -> None:
        self.info, self.faults, self.profile, self.pace = stream.info, stream.faults, stream.info.profile, pace
        self._frames, self._ledger = iter(stream), ledger

    def start(self) -> None:
        """No effect."""

    def take(self, timeout_s: float) -> Received:
        """The next frame, however long it takes.

        Raises:
            StreamEndedError: there is none.
        """
        self.pace.wait()  # before the frame is read, so that poses received meanwhile apply to it
        frame = self._ledger.run(SOURCE, next, self._frames, None)
        if frame is None:
            raise StreamEndedError
        return Received(frame, 0.0)

    def health(self) -> dict[str, Any]:
        """Nothing is received."""
        return {}

    def close(self) -> None:
        """No effect."""
