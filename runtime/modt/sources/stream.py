"""Interface of the sources of frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol, Self

from modt.geometry import Camera
from modt.types import Frame


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """Properties of a stream known before its first frame.

    Attributes:
        name: of the stream.
        layout: recognised kind of source.
        sequence: KITTI tracking sequence number, 0 for none.
        n_frames: number of frames, None for a live stream.
        period_s: nominal time between frames [s].
        camera: reference of annotations and KITTI results, None without one.
        has_poses: frames carry T_world_sensor.
        notes: missing files and their consequences.
        pose_notes: the same of its poses, irrelevant with another pose source.
        end: index of the last frame plus one, None where unknown.
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
    """An unusable scan, or unusable points of one.

    Attributes:
        frame: index of the frame.
        subject: file or device.
        cause: of the fault.
        skipped: the whole scan is skipped.
    """

    frame: int
    subject: str
    cause: str
    skipped: bool


MAX_KEPT_FAULTS = 20
"""Faults kept; later ones are only counted."""


@dataclass(slots=True)
class Faults:
    """Faults of a stream.

    Attributes:
        count: of all faults.
        skipped: number of skipped scans.
        first: the first MAX_KEPT_FAULTS faults.
    """

    count: int = 0
    skipped: int = 0
    first: list[Fault] = field(default_factory=list)

    def add(self, fault: Fault) -> bool:
        """Count a fault; whether it is kept."""
        self.count += 1
        self.skipped += fault.skipped
        kept = self.count <= MAX_KEPT_FAULTS
        if kept:
            self.first.append(fault)
        return kept


class Stream(Protocol):
    """A source of frames, ordered by time."""

    info: StreamInfo
    faults: Faults

    def __iter__(self) -> Iterator[Frame]:
        """The frames; faults are added to `faults` on the way."""
        ...

    def between(self, first: int, last: int | None) -> Self:
        """The stream of the frames with first <= index < last."""
        ...
