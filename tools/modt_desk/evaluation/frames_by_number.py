"""Frames of a stream by their numbers."""

from __future__ import annotations

from collections.abc import Iterator

from modt.sources.stream import Stream
from modt.types import Frame


class FramesByNumber:
    """Gives frames by ascending number and skips those between."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._frames: Iterator[Frame] | None = None  # begins with the first number that is asked for
        self._next: Frame | None = None

    def get(self, number: int) -> Frame | None:
        """The frame, None if the stream does not hold it."""
        if self._frames is None:
            self._frames = iter(self._stream.between(number, None))
            self._next = next(self._frames, None)
        while self._next is not None and self._next.index < number:
            self._next = next(self._frames, None)
        return self._next if self._next is not None and self._next.index == number else None
