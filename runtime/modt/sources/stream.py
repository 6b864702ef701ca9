"""Interfaces of the sources of frames: recorded streams, and readers of live sensors."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from modt.geometry import Camera
from modt.types import COMPENSATED, DESKEWED, NO_TURN, Float32, Frame, Self

log = logging.getLogger(__name__)


@dataclass(frozen=True)
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
    began_s: float = 0.0  # time of stamp 0 on the clock of the recording [s]


@dataclass(frozen=True)
class Fault:
    """An unusable scan, or unusable points of one."""

    frame: int  # index of the frame
    subject: str  # file or device
    cause: str  # the fault
    skipped: bool  # the whole scan is skipped


MAX_STAMP_S = 1e11
"""Three thousand years; a greater stamp is no time in seconds [s]."""


UNITS = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
"""Number of each unit of time in a second."""


def unit_of(ratio: float) -> str:
    """Unit of a time by its ratio to the same time in seconds; empty if the ratio fits no unit."""
    return next((name for name, number in UNITS.items() if abs(ratio / number - 1.0) < 0.02), "")


def no_seconds(stamp_s: float) -> str:
    """Reason why a stamp is no time in seconds, with its unit if it is a time since 1970; empty if it is one."""
    if abs(stamp_s) < MAX_STAMP_S:
        return ""
    fitting = (name for name, number in UNITS.items() if abs(stamp_s) < MAX_STAMP_S * number)
    unit = next((f": it is one in {name}" for name in fitting), "")
    return f"stamp {stamp_s:g} is no time in seconds{unit}"


_NUMBER = re.compile(r"[-+]?\d[\d.e+]*")


def reason_of(cause: str) -> str:
    """Cause of a fault without its numbers, by which faults are counted."""
    return _NUMBER.sub("N", cause)


MAX_KEPT_FAULTS = 20
"""Number of faults that are kept and logged; later ones are only counted."""


@dataclass(slots=True)
class Faults:
    """Faults of a stream."""

    count: int = 0  # number of all faults
    skipped: int = 0  # number of skipped scans
    first: list[Fault] = field(default_factory=list)  # the first MAX_KEPT_FAULTS faults
    left_out: Counter[str] = field(default_factory=Counter)  # what was asked for and not read: numbers by reason

    def leave_out(self, frame: int, subject: object, reason: str, number: int = 1) -> None:
        """Count and log what is not read before a frame, and is no sweep that can be told."""
        self.left_out[reason] += number
        self.report(frame, subject, reason if number == 1 else f"{number} {reason}", skipped=False)

    def report(self, frame: int, subject: object, cause: str, *, skipped: bool) -> None:
        """Count a fault, and log it unless there are too many."""
        self.count += 1
        self.skipped += skipped
        if skipped:
            self.left_out[reason_of(cause)] += 1
        if self.count <= MAX_KEPT_FAULTS:
            self.first.append(Fault(frame, str(subject), cause, skipped))
            more = "; later faults are only counted" if self.count == MAX_KEPT_FAULTS else ""
            log.warning("%s: frame %d: %s%s%s", subject, frame, cause, "; frame skipped" if skipped else "", more)


@dataclass(slots=True)
class Reading:
    """Counts of what the latest pass over a stream has read."""

    messages: int = 0  # messages, packets or files of sweeps
    sweeps: int = 0  # sweeps that they hold, usable or not
    joined: int = 0  # messages that are parts of a turn, and were joined
    times: Counter[str] = field(default_factory=Counter)  # sweeps by what the times of their points are
    corrected: Counter[str] = field(
        default_factory=Counter
    )  # messages by what they say of their layout and is not so
    frame_id: str = ""  # frame of the points, where messages name it
    poses: str = ""  # where the poses are from
    without_pose: int = 0  # frames that have none of these poses
    alone: Counter[str] = field(default_factory=Counter)  # sweeps without one of another sensor, by sensor


class Stream(Protocol):
    """A source of frames, ordered by time."""

    info: StreamInfo
    faults: Faults

    @property
    def reading(self) -> Reading:
        """Counts of what was read so far."""

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; faults are added to `faults` on the way."""

    def between(self, first: int, last: int | None) -> Self:
        """Stream of the frames with first <= index < last."""


@dataclass(frozen=True)
class Received:
    """A frame, and the time at which its sweep was complete and checked, on the clock of the stream [s].

    A recording that is not played as if it were live has time 0.
    """

    frame: Frame
    arrived_s: float


class StreamEndedError(Exception):
    """The source has no more sweeps."""


@dataclass(frozen=True)
class Sweep:
    """One turn of a sensor.

    Attributes:
        stamp_s, points, turn_s, mid_rad, frame_id, delay_s: as in modt.types.Frame; points may hold values that are
            not finite.
        complete: no message of the turn is known to be missing.
        index: index of the frame in its recording; None numbers the sweeps as they come.
        waited_s: time for which its last message lay in the kernel before it was read [s].
    """

    stamp_s: float
    points: Float32
    turn_s: float = 0.0
    complete: bool = True
    index: int | None = None
    frame_id: str = ""
    waited_s: float = 0.0
    mid_rad: float = 0.0
    delay_s: Float32 | None = None

    @property
    def times(self) -> str:
        """Kind of the times of its points."""
        if self.turn_s:
            return DESKEWED
        return COMPENSATED if self.delay_s is None else NO_TURN


@dataclass(slots=True)
class Reception:
    """Counts of received messages, and of refusals by their reason."""

    messages: int = 0  # messages taken from the network or file
    lost: int = 0  # messages missing by their sequence numbers, stamps or angles
    refused: dict[str, int] = field(default_factory=dict)  # number of unusable messages by reason
    joined: int = 0  # messages that are parts of a turn, and were joined
    frame_id: str = ""  # frame of the points, where messages name it
    silence: str = ""  # why no messages come, with the remedy, where it is known

    def refuse(self, reason: str) -> bool:
        """Count a refused message; True for the first one with this reason."""
        self.refused[reason] = self.refused.get(reason, 0) + 1
        return self.refused[reason] == 1


OTHER_SENSOR = "of another head: do several sensors send to this port?"
"""Reason of the refusal of packets from where the head cannot be."""


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
