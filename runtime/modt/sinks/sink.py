"""Interface of the sinks."""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

from modt.types import FrameResult

T_contra = TypeVar("T_contra", contravariant=True)


class Writer(Protocol[T_contra]):
    """Takes items one by one."""

    def write(self, item: T_contra, /) -> None:
        """Write one item; it has reached the operating system on return."""
        ...

    def close(self) -> None:
        """Close the files."""
        ...


Sink = Writer[FrameResult]
LineSink = Writer[dict[str, Any]]
