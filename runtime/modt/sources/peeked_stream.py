"""A stream whose first frame is known before it starts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Self

from modt.sources.stream import Faults, Stream, StreamInfo
from modt.types import Frame


class PeekedStream:
    """A stream that has read its first frame, with which the first pass through it begins."""

    def __init__(self, stream: Stream) -> None:
        self._stream, self._rest = stream, iter(stream)
        self.info: StreamInfo = stream.info
        self.faults: Faults = stream.faults
        self.first: Frame | None = next(self._rest, None)
        self._begun = self.first is None

    def __iter__(self) -> Iterator[Frame]:
        """The frames."""
        if self._begun or self.first is None:
            return iter(self._stream)
        self._begun = True
        return chain([self.first], self._rest)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last."""
        return type(self)(self._stream.between(first, last))
