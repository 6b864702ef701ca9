"""What every sink offers."""

from __future__ import annotations

from typing import Any, Protocol

from modt.types import FrameResult


class Sink(Protocol):
    """Takes results, frame by frame."""

    def write(self, result: FrameResult) -> None:
        """Keep one result; it is on its way to the disk when this returns."""
        ...

    def close(self) -> None:
        """No more will come."""
        ...


class LineSink(Protocol):
    """Takes records, line by line."""

    def write(self, record: dict[str, Any]) -> None:
        """Keep one record."""
        ...

    def close(self) -> None:
        """No more will come."""
        ...
