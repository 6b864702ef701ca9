"""Playback of a recording as if its sensor were measuring."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence

from modt.sources.stream import Reception, Stream, StreamEndedError, Sweep
from modt.types import Frame


class PlayedReader:
    """Sweeps of a stream at the pace of their stamps, without their poses.

    Args:
        stream: the recording.
        loop: start over at its end, with stamps that go on.
        clock: monotonic clock [s].
        wait: waits for a time [s]; returns True, possibly earlier, if the reader is closed.
    """

    profile = None  # the stream has it

    def __init__(
        self,
        stream: Stream,
        *,
        loop: bool = False,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], bool] | None = None,
    ) -> None:
        self.reception = Reception()
        self._stream, self._loop, self._closed = stream, loop, threading.Event()
        self._clock, self._wait = clock, wait or self._closed.wait
        self._frames = _again(stream) if loop else ((frame.stamp_s, frame) for frame in stream)
        self._next: tuple[float, Frame] | None = None  # read before it is due
        self._start_s: float | None = None  # time of stamp 0 by the clock

    def read(self, timeout_s: float) -> Sequence[Sweep]:
        """Next sweep, if it is due within the timeout."""
        if self._closed.is_set():
            raise StreamEndedError
        if self._next is None:
            self._next = next(self._frames, None)
            if self._next is None:
                raise StreamEndedError
        (stamp_s, frame), now_s = self._next, self._clock()
        if self._start_s is None:
            self._start_s = now_s - stamp_s
        due_s = self._start_s + stamp_s - now_s
        if due_s > timeout_s:
            self._wait(timeout_s)
            return ()
        if due_s > 0 and self._wait(due_s):
            return ()
        self._next = None
        self.reception.messages += 1
        if self._stream.faults.count:
            self.reception.refused["faulty scans"] = self._stream.faults.count
        return (Sweep(stamp_s, frame.points, frame.turn_s, index=None if self._loop else frame.index),)

    def close(self) -> None:
        """End a wait."""
        self._closed.set()


def _again(stream: Stream) -> Iterator[tuple[float, Frame]]:
    """Endless frames of a stream; stamps advance by one period from its end to its beginning."""
    played_s: float | None = None
    while True:
        offset_s: float | None = None
        for frame in stream:
            if offset_s is None:
                offset_s = 0.0 if played_s is None else played_s + stream.info.period_s - frame.stamp_s
            played_s = offset_s + frame.stamp_s
            yield played_s, frame
        if offset_s is None:
            return
