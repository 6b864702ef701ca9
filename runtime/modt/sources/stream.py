"""Interface of the sources of frames."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from modt.geometry import Camera
from modt.types import Frame, Self

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """Properties of a stream known before its first frame."""

    name: str  # name of the stream
    layout: str  # recognised kind of source
    sequence: int = 0  # KITTI tracking sequence number, 0 for none
    n_frames: int | None = None  # number of frames, None where unknown, as in a live stream
    period_s: float = 0.1  # nominal time between frames [s]
    camera: Camera | None = None  # reference of annotations and KITTI results, None without one
    has_poses: bool = False  # frames carry T_world_sensor
    notes: tuple[str, ...] = ()  # missing files and their consequences
    pose_notes: tuple[str, ...] = ()  # missing files of the poses, irrelevant with another pose source
    end: int | None = None  # index of the last frame plus one, None where unknown
    profile: str | None = None  # shipped profile of the sensor, where its messages identify it
    elevations_deg: tuple[float, ...] | None = None  # elevations of its beams, where its metadata have them


@dataclass(frozen=True, slots=True)
class Fault:
    """An unusable scan, or unusable points of one."""

    frame: int  # index of the frame
    subject: str  # file or device
    cause: str  # what is wrong with it
    skipped: bool  # the whole scan is skipped


MAX_STAMP_S = 1e11
"""Three thousand years; a greater stamp is no time in seconds [s]."""


def unit_of(ratio: float) -> str:
    """Name of the unit of a time that is `ratio` times another one in seconds; empty if it is no unit."""
    units = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
    return next((name for factor, name in units.items() if abs(ratio / factor - 1.0) < 0.02), "")


def no_seconds(stamp_s: float) -> str:
    """Reason why a stamp is no time in seconds, with its unit if it is a time since 1970; empty if it is one."""
    if abs(stamp_s) < MAX_STAMP_S:
        return ""
    limits = {1e14: "milliseconds", 1e17: "microseconds", 1e20: "nanoseconds"}
    unit = next((f": it is one in {name}" for most, name in limits.items() if abs(stamp_s) < most), "")
    return f"stamp {stamp_s:g} is no time in seconds{unit}"


MAX_KEPT_FAULTS = 20
"""Number of faults that are kept and logged; later ones are only counted."""


@dataclass(slots=True)
class Faults:
    """Faults of a stream."""

    count: int = 0  # number of all faults
    skipped: int = 0  # number of skipped scans
    first: list[Fault] = field(default_factory=list)  # the first MAX_KEPT_FAULTS faults

    def report(self, frame: int, subject: object, cause: str, *, skipped: bool, place: str = "") -> None:
        """Count a fault, and log it unless there are too many; `place` names it in the log instead of `subject`."""
        self.count += 1
        self.skipped += skipped
        if self.count <= MAX_KEPT_FAULTS:
            self.first.append(Fault(frame, str(subject), cause, skipped))
            more = "; later faults are only counted" if self.count == MAX_KEPT_FAULTS else ""
            log.warning("%s: %s%s%s", place or subject, cause, "; frame skipped" if skipped else "", more)


class Stream(Protocol):
    """A source of frames, ordered by time."""

    info: StreamInfo
    faults: Faults

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; faults are added to `faults` on the way."""

    def between(self, first: int, last: int | None) -> Self:
        """Stream of the frames with first <= index < last."""
