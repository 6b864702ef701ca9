"""Sweeps of several sensors of a robot, joined by their times."""

from __future__ import annotations

import copy
import heapq
import logging
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace

from modt.config import MountedSensor
from modt.geometry import inverse
from modt.placement import joined_points
from modt.sources.stream import Faults, Reading, Stream, StreamInfo
from modt.types import Frame, Self

log = logging.getLogger(__name__)

JOINED_PERIODS = 0.6
"""Greatest time between the sweeps of one frame [periods of the faster sensor]. The nearest sweep is half a period
away at most; the rest keeps sensors that are half a period apart from changing partners with every jitter."""
ROBOT = "base_footprint"
"""Name of the frame of a robot whose origin is on the ground (REP 120)."""
Sweeps = dict[int, Frame]
"""Sweeps of one frame by the numbers of their sensors."""


class SweepJoiner:
    """Joins the sweeps of n sensors that are at most `tolerance_s` apart; each is used once.

    Attributes:
        absent: sensors that are not waited for, until they have a sweep again.
    """

    def __init__(self, n: int, tolerance_s: float) -> None:
        self.absent: set[int] = set()
        self._n = n
        self._tolerance_s = tolerance_s
        self._held: Sweeps = {}

    def add(self, sensor: int, sweep: Frame) -> Iterator[Sweeps]:
        """Hold a sweep, whose stamp is on the common clock, and yield the sweeps of each frame that is complete now.

        A sweep that is too far in time from those that wait, or a second one of its sensor, ends their frame.
        """
        self.absent.discard(sensor)
        if self._held and (sensor in self._held or self._is_far(sweep.stamp_s)):
            yield self.take()
        self._held[sensor] = sweep
        if len(self.absent | self._held.keys()) == self._n:
            yield self.take()

    @property
    def waiting(self) -> bool:
        """Whether a sweep waits for those of other sensors."""
        return bool(self._held)

    def take(self) -> Sweeps:
        """End the frame of the sweeps that wait for others, and return them; empty if there are none."""
        held = self._held
        self._held = {}
        return held

    def _is_far(self, stamp_s: float) -> bool:
        return any(abs(stamp_s - held.stamp_s) > self._tolerance_s for held in self._held.values())


def joint_frame(index: int, sweeps: Sweeps, sensors: Sequence[MountedSensor]) -> Frame:
    """The frame of sweeps in the frame of the robot, at the stamp of the first sensor that has one."""
    by_sensor = tuple(sweeps.get(k) for k in range(len(sensors)))
    points = joined_points(by_sensor, [sensor.T_robot_sensor for sensor in sensors])
    lead = min(sweeps)
    first = sweeps[lead]
    T = first.T_world_sensor
    T_world_robot = None if T is None else T @ inverse(sensors[lead].T_robot_sensor)
    return Frame(
        index, first.stamp_s, points, T_world_robot, steady_s=first.steady_s, sweeps=by_sensor, frame_id=ROBOT
    )


def joined_reading(parts: Sequence[Reading], alone: Counter[str]) -> Reading:
    """Counts of all sensors together. Numbers and lists are added; of texts the first one counts."""
    total = Reading()
    for part in parts:
        for name in (field.name for field in fields(Reading)):
            before = getattr(total, name)
            more = getattr(part, name)
            setattr(total, name, (before or more) if isinstance(more, str) else before + more)
    total.alone = alone
    return total


def joined_info(infos: Mapping[str, StreamInfo]) -> StreamInfo:
    """Properties of the streams of the sensors by their names."""
    first = next(iter(infos.values()))
    names = dict.fromkeys(info.name for info in infos.values())
    return StreamInfo(
        name=f"{', '.join(infos)} of {', '.join(names)}",
        layout=first.layout,
        period_s=first.period_s,
        has_poses=any(info.has_poses for info in infos.values()),
        notes=tuple(f"{name}: {note}" for name, info in infos.items() for note in info.notes),
        pose_notes=tuple(f"{name}: {note}" for name, info in infos.items() for note in info.pose_notes),
        began_s=first.began_s,
    )


def tolerance_s(infos: Sequence[StreamInfo]) -> float:
    """Greatest time between the sweeps of one frame [s]."""
    return JOINED_PERIODS * min(info.period_s for info in infos)


class JointStream:
    """Frames of the recorded streams of several sensors, by their stamps."""

    def __init__(self, sensors: Sequence[MountedSensor], streams: Sequence[Stream]) -> None:
        self.info = joined_info({s.name: stream.info for s, stream in zip(sensors, streams, strict=True)})
        self.faults = Faults()
        self._sensors = sensors
        self._streams = streams
        self._share_faults()
        self._alone: Counter[str] = Counter()
        self._first = 0
        self._last: int | None = None

    @property
    def reading(self) -> Reading:
        """Counts of what was read so far."""
        return joined_reading([stream.reading for stream in self._streams], self._alone)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames. A sensor without a sweep near those of the others has none in a frame, and is logged."""
        self._alone = Counter()
        together = 0
        index = -1
        for index, sweeps in enumerate(self._joined()):
            if self._last is not None and index >= self._last:
                return
            together += len(sweeps) > 1
            if len(sweeps) == 1 < len(self._sensors):
                self._alone[self._sensors[min(sweeps)].name] += 1
            if index >= self._first:
                yield joint_frame(index, sweeps, self._sensors)
        if index >= 0 and not together and len(self._sensors) > 1:
            remedy = "the clocks of the sensors differ: synchronise them, or record the times of one clock"
            log.warning("%s: no sweeps of two sensors are near one another in time; %s", self.info.name, remedy)

    def between(self, first: int, last: int | None) -> Self:
        """Frames with first <= index < last; those before are read to count them."""
        part = copy.copy(self)
        part.faults = Faults()
        part._streams = [stream.between(0, None) for stream in self._streams]
        part._share_faults()
        part._first = max(first, self._first)
        part._last = min((end for end in (last, self._last) if end is not None), default=None)
        return part

    def _share_faults(self) -> None:
        """Let all streams report to the faults of this one."""
        for stream in self._streams:
            stream.faults = self.faults

    def _joined(self) -> Iterator[Sweeps]:
        joiner = SweepJoiner(len(self._streams), tolerance_s([stream.info for stream in self._streams]))
        in_order = heapq.merge(*map(self._timed, range(len(self._streams))), key=lambda timed: timed[0])
        for _, sensor, sweep in in_order:
            yield from joiner.add(sensor, sweep)
        if last := joiner.take():
            yield last

    def _timed(self, sensor: int) -> Iterator[tuple[float, int, Frame]]:
        """Yield stamp on the clock of the first stream, sensor and sweep."""
        stream = self._streams[sensor]
        shift_s = stream.info.began_s - self.info.began_s
        for frame in stream:
            sweep = replace(frame, stamp_s=frame.stamp_s + shift_s)
            yield sweep.stamp_s, sensor, sweep
