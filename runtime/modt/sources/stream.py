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

    name: str  # of the stream
    layout: str  # recognised kind of source
    sequence: int  # KITTI tracking sequence number, 0 for none
    n_frames: int | None  # number of frames, None for a live stream
    period_s: float  # nominal time between frames [s]
    camera: Camera | None  # reference of annotations and KITTI results, None without one
    has_poses: bool  # frames carry T_world_sensor
    notes: tuple[str, ...] = ()  # missing files and their consequences
    pose_notes: tuple[str, ...] = ()  # the same of its poses, irrelevant with another pose source
    end: int | None = None  # index of the last frame plus one, None where unknown
    profile: str | None = None  # shipped profile of the sensor, where its messages say what it is
    elevations_deg: tuple[float, ...] | None = None  # of its beams, where its metadata have them


@dataclass(frozen=True, slots=True)
class Fault:
    """An unusable scan, or unusable points of one."""

    frame: int  # index of the frame
    subject: str  # file or device
    cause: str  # of the fault
    skipped: bool  # the whole scan is skipped


MAX_STAMP_S = 1e11
"""Three thousand years: a stamp beyond it is no time in seconds."""


def unit_of(ratio: float) -> str:
    """Unit of a time that is so many times another one in seconds; empty where it is none."""
    units = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
    return next((name for factor, name in units.items() if abs(ratio / factor - 1.0) < 0.02), "")


def no_seconds(stamp_s: float) -> str:
    """Why a stamp is no time in seconds, and the unit in which it is one since 1970; empty if it is one."""
    if abs(stamp_s) < MAX_STAMP_S:
        return ""
    limits = {1e14: "milliseconds", 1e17: "microseconds", 1e20: "nanoseconds"}
    unit = next((f": it is one in {name}" for most, name in limits.items() if abs(stamp_s) < most), "")
    return f"stamp {stamp_s:g} is no time in seconds{unit}"


MAX_KEPT_FAULTS = 20
"""Faults kept; later ones are only counted."""


@dataclass(slots=True)
class Faults:
    """Faults of a stream."""

    count: int = 0  # of all faults
    skipped: int = 0  # number of skipped scans
    first: list[Fault] = field(default_factory=list)  # the first MAX_KEPT_FAULTS faults

    def add(self, fault: Fault) -> bool:
        """Count a fault; whether it is kept."""
        self.count += 1
        self.skipped += fault.skipped
        kept = self.count <= MAX_KEPT_FAULTS
        if kept:
            self.first.append(fault)
        return kept

    def report(self, fault: Fault, place: str) -> None:
        """Count a fault, and log it where it is kept; `place` is its subject for the log."""
        if self.add(fault):
            more = "; later faults are only counted" if self.count == MAX_KEPT_FAULTS else ""
            log.warning("%s: %s%s%s", place, fault.cause, "; frame skipped" if fault.skipped else "", more)


class Stream(Protocol):
    """A source of frames, ordered by time."""

    info: StreamInfo
    faults: Faults

    def __iter__(self) -> Iterator[Frame]:
        """The frames; faults are added to `faults` on the way."""

    def between(self, first: int, last: int | None) -> Self:
        """The stream of the frames with first <= index < last."""
