"""Interface of the readers that turn a sensor's messages into sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from modt.types import Float32, Frame


@dataclass(frozen=True, slots=True)
class Received:
    """A frame, and the time at which its sweep was complete and checked, on the clock of the stream [s]."""

    frame: Frame
    arrived_s: float


class StreamEndedError(Exception):
    """The source has no more sweeps."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """One turn of a sensor.

    Attributes:
        stamp_s, points, turn_s, frame_id: as in modt.types.Frame; points may hold values that are not finite.
        complete: no message of the turn is known to be missing.
        index: index of the frame in its recording; None numbers the sweeps as they come.
    """

    stamp_s: float
    points: Float32
    turn_s: float = 0.0
    complete: bool = True
    index: int | None = None
    frame_id: str = ""


@dataclass(slots=True)
class Reception:
    """Counts of received messages, and of refusals by their reason."""

    messages: int = 0  # messages taken from the network or file
    lost: int = 0  # messages missing by their sequence numbers, stamps or angles
    refused: dict[str, int] = field(default_factory=dict)  # number of unusable messages by reason
    frame_id: str = ""  # frame of the points, where messages name it

    def refuse(self, reason: str) -> bool:
        """Count a refused message; True for the first one with this reason."""
        self.refused[reason] = self.refused.get(reason, 0) + 1
        return self.refused[reason] == 1


class SweepReader(Protocol):
    """Turns messages of one sensor into sweeps; used by one thread."""

    reception: Reception

    @property
    def profile(self) -> str | None:
        """Shipped profile of the sensor; None where there is none, or before its messages have identified it."""

    def read(self, timeout_s: float) -> Sequence[Sweep]:
        """Sweeps finished by the messages received until the timeout, oldest first; returns as soon as there is one.

        Bytes that are no message of the sensor are counted and raise nothing.

        Raises:
            StreamEndedError: nothing follows, as at the end of a recording.
        """

    def close(self) -> None:
        """Release the socket; another thread may be in `read`, which then returns or raises OSError."""
