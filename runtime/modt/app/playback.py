"""A recording as a source of frames: every one of them, at full speed or at a rate."""

from __future__ import annotations

import time
from collections.abc import Callable

from modt.energy.ledger import Ledger
from modt.pipeline import SOURCE
from modt.sources.stream import Reading, Received, Stream, StreamEndedError


class Playback:
    """The frames of a stream. Reading a frame is a span of the ledger.

    At a rate, frames begin at absolute times, which restart after an overrun so that no burst follows.

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
        self.info = stream.info
        self._stream = stream
        self.faults = stream.faults
        self.profile = stream.info.profile
        self._frames = iter(stream)
        self._ledger = ledger
        self._period_s = None if rate_hz is None else 1.0 / rate_hz
        self._sleep = sleep
        self._clock = clock
        self._due_s: float | None = None  # time of the next frame

    @property
    def reading(self) -> Reading:
        """Counts of what was read so far."""
        return self._stream.reading

    def start(self) -> None:
        """No effect."""

    def take(self, timeout_s: float) -> Received:
        """The next frame, without a time limit.

        Raises:
            StreamEndedError: there is none.
        """
        if self._period_s is not None:
            self._wait(self._period_s)  # before the frame is read, so that poses received meanwhile apply to it
        frame = self._ledger.run(SOURCE, next, self._frames, None)
        if frame is None:
            raise StreamEndedError
        return Received(frame, 0.0)

    def close(self) -> None:
        """No effect."""

    def _wait(self, period_s: float) -> None:
        """Sleep until the frame is due. After a delay of more than a period the due times start anew."""
        now_s = self._clock()
        due_s = now_s if self._due_s is None else self._due_s
        if now_s < due_s:
            self._sleep(due_s - now_s)
            now_s = self._clock()
        self._due_s = period_s + (now_s if now_s - due_s > period_s else due_s)
