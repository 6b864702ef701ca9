"""Interface of the sinks."""

from __future__ import annotations

from typing import Any, Protocol

from modt.types import FrameResult


class Sink(Protocol):
    """Takes results, frame by frame."""

    def write(self, result: FrameResult) -> None:
        """Write one result; it has reached the operating system on return."""
        ...

    def close(self) -> None:
        """Close the files."""
        ...


class LineSink(Protocol):
    """Takes records, line by line."""

    def write(self, record: dict[str, Any]) -> None:
        """Write one record."""
        ...

    def close(self) -> None:
        """Close the file."""
        ...
