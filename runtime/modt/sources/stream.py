"""What every source offers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol, Self

from modt.geometry import Camera
from modt.types import Frame


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """What is known of a stream before its first frame.

    Attributes:
        name: of the stream, for people.
        layout: kind of source it was recognised as.
        sequence: its KITTI tracking sequence number, 0 where it has none.
        n_frames: frames to expect, None for an endless stream.
        period_s: nominal time between frames [s].
        camera: camera that the annotations and KITTI results refer to, None where there is none.
        has_poses: frames carry T_world_sensor.
        notes: what is missing, and what that costs.
        pose_notes: the same of its own poses; of no account where they come from elsewhere.
        end: one more than the number of the last frame, None where it is not known.
    """

    name: str
    layout: str
    sequence: int
    n_frames: int | None
    period_s: float
    camera: Camera | None
    has_poses: bool
    notes: tuple[str, ...] = ()
    pose_notes: tuple[str, ...] = ()
    end: int | None = None


@dataclass(frozen=True, slots=True)
class Fault:
    """A scan, or part of one, that could not be used.

    Attributes:
        frame: its index.
        subject: file or device.
        cause: what was wrong.
        skipped: the whole scan was left out.
    """

    frame: int
    subject: str
    cause: str
    skipped: bool


FIRST = 20
"""Faults that are kept; of those after them only the number is."""


@dataclass(slots=True)
class Faults:
    """Scans, or parts of some, that could not be used.

    Attributes:
        count: of all.
        skipped: scans left out.
        first: the FIRST of them.
    """

    count: int = 0
    skipped: int = 0
    first: list[Fault] = field(default_factory=list)

    def add(self, fault: Fault) -> bool:
        """One more; whether it is among the first."""
        self.count += 1
        self.skipped += fault.skipped
        early = self.count <= FIRST
        if early:
            self.first.append(fault)
        return early


class Stream(Protocol):
    """A source of frames, in the order of time."""

    info: StreamInfo
    faults: Faults

    def __iter__(self) -> Iterator[Frame]:
        """The frames; what had to be left out is added to faults meanwhile."""
        ...

    def between(self, first: int, last: int | None) -> Self:
        """The stream cut to the frames with first <= index < last."""
        ...
