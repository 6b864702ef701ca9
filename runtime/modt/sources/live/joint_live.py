"""Several live sensors of a robot as one source, whose sweeps are joined by their times."""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from modt.config import MountedSensor
from modt.sources.joining import (
    SweepJoiner,
    Sweeps,
    joined_info,
    joined_reading,
    joint_frame,
    tolerance_s,
)
from modt.sources.live.live_stream import LiveStream
from modt.sources.packets.device_clock import DeviceClock
from modt.sources.stream import Faults, Reading, Received, StreamEndedError, StreamInfo
from modt.types import Frame

log = logging.getLogger(__name__)

CLOCKS_AGREE_S = 0.2
"""Greatest difference between the delays of two sensors, stamp to arrival, with stamps of one clock [s]."""
WAITED_PERIODS = 0.8
"""Time for which a sweep waits for those of other sensors after it came [periods]. It is more than the time between
the sweeps of one frame, by what the networks of the sensors differ in."""
SUMS = ("messages", "lost_messages", "sweeps", "incomplete_sweeps", "dropped_sweeps", "silences", "time_steps")
"""Counts of the health that are added over the sensors."""


class JointLive:
    """Hands over frames with the sweeps of several sensors; the interface is that of LiveStream.

    A sensor that is silent is waited for once. The others go on meanwhile.

    Args:
        sensors: the sensors of the profile.
        streams: their streams, open and not started.
        clock: monotonic [s].
        wait: waits for a sweep of any stream, at most for a time [s].
    """

    profile = None  # each sensor has its own

    def __init__(
        self,
        sensors: Sequence[MountedSensor],
        streams: Sequence[LiveStream],
        *,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] | None = None,
    ) -> None:
        self.info: StreamInfo = joined_info({s.name: stream.info for s, stream in zip(sensors, streams, strict=True)})
        self._sensors = sensors
        self._streams = streams
        self._clock = clock
        self._wait = wait or self._wait_for_arrival
        self._arrived = threading.Condition()
        self.faults = Faults()
        for sensor, stream in zip(sensors, streams, strict=True):
            stream.info = replace(stream.info, name=f"{sensor.name} of {stream.info.name}")  # as the log names it
            stream.arrived = self._arrived
            stream.faults = self.faults
        self._joiner = SweepJoiner(len(streams), tolerance_s([stream.info for stream in streams]))
        self._clocks = [DeviceClock() for _ in streams]
        self._reference: int | None = None  # sensor whose clock is that of the frames: the first that was heard
        self._began_s: float | None = None  # arrival of the first sweep, at which the steady time is 0
        self._steady_shift_s: dict[int, float] = {}  # from the steady time of a stream to that of the frames
        self._differing: set[int] = set()  # sensors whose clock differs from the reference
        self._ended: dict[int, Exception] = {}
        self._waiting_since_s: float | None = None  # arrival of the sweep that waits longest for others
        self._ready: deque[Received] = deque()
        self._alone: Counter[str] = Counter()
        self._index = 0

    def start(self) -> None:
        """Start receiving."""
        for stream in self._streams:
            stream.start()

    def close(self) -> None:
        """End the receiving threads."""
        for stream in self._streams:
            stream.close()

    @property
    def period_s(self) -> float:
        """Mean time between the sweeps of the first sensor that still sends [s]."""
        sending = (stream for k, stream in enumerate(self._streams) if k not in self._joiner.absent)
        return next(sending, self._streams[0]).period_s

    @property
    def reading(self) -> Reading:
        """Counts of what was read so far."""
        return joined_reading([stream.reading for stream in self._streams], self._alone)

    def health(self) -> dict[str, Any]:
        """Counts of all sensors together, and of each by its name."""
        parts = {s.name: stream.health() for s, stream in zip(self._sensors, self._streams, strict=True)}
        each = list(parts.values())
        refused = sum((Counter(part["refused_messages"]) for part in each), Counter[str]())
        return {
            **{name: sum(part[name] for part in each) for name in SUMS},
            "refused_messages": dict(refused),
            "silent": all(part["silent"] for part in each),
            "period_s": round(self.period_s, 4),
            "frame_id": "",
            "silence": "; ".join(f"{name}: {part['silence']}" for name, part in parts.items() if part["silence"]),
            "alone": dict(self._alone),
            "sensors": parts,
        }

    def take(self, timeout_s: float) -> Received | None:
        """Wait at most `timeout_s` for the next frame; None without one.

        Raises:
            Exception: all sensors have ended; the error that ended the first of them.
        """
        until_s = self._clock() + timeout_s
        while True:
            self._collect()
            if self._ready:
                return self._ready.popleft()
            if len(self._ended) == len(self._streams):
                raise next(iter(self._ended.values()))
            now_s = self._clock()
            due_s = until_s
            if self._waiting_since_s is not None:
                due_s = min(due_s, self._waiting_since_s + WAITED_PERIODS * self.info.period_s)
            if now_s >= until_s:
                return None
            if due_s > now_s:
                self._wait(due_s - now_s)

    def _collect(self) -> None:
        """Take what the sensors have received, and end a frame that has waited long enough for its other sweeps."""
        for sensor, stream in enumerate(self._streams):
            if sensor in self._ended:
                continue
            try:
                received = stream.take(0.0)
            except Exception as error:
                self._end(sensor, error)
                continue
            if received is not None:
                self._add(sensor, received)
        since_s = self._waiting_since_s
        if since_s is None:
            return
        everyone_ended = len(self._ended) == len(self._streams)
        if everyone_ended or self._clock() - since_s >= WAITED_PERIODS * self.info.period_s:
            sweeps = self._joiner.take()
            self._joiner.absent |= set(range(len(self._streams))) - sweeps.keys()
            self._hand_over(sweeps, since_s)

    def _end(self, sensor: int, error: Exception) -> None:
        """Go on without a sensor whose stream has ended."""
        self._ended[sensor] = error
        self._joiner.absent.add(sensor)
        if not isinstance(error, StreamEndedError):
            log.error("sensor %s has ended: %s; the others go on", self._sensors[sensor].name, error)

    def _add(self, sensor: int, received: Received) -> None:
        sweep = self._on_common_clock(sensor, received)
        for sweeps in self._joiner.add(sensor, sweep):
            self._hand_over(sweeps, received.arrived_s)
        if self._joiner.waiting and self._waiting_since_s is None:
            self._waiting_since_s = received.arrived_s

    def _hand_over(self, sweeps: Sweeps, arrived_s: float) -> None:
        """Make a frame of sweeps that wait no longer."""
        self._waiting_since_s = None
        if len(sweeps) == 1 < len(self._streams):
            self._alone[self._sensors[min(sweeps)].name] += 1
        self._ready.append(Received(joint_frame(self._index, sweeps, self._sensors), arrived_s))
        self._index += 1

    def _on_common_clock(self, sensor: int, received: Received) -> Frame:
        """The sweep with stamp and steady time on the clocks of the frames."""
        sweep = received.frame
        self._clocks[sensor].unwrapped(sweep.stamp_s, received.arrived_s)  # measures the offset of its clock
        if self._reference is None or self._began_s is None:
            self._reference = sensor
            self._began_s = received.arrived_s
        ahead_s = self._clocks[sensor].offset_s - self._clocks[self._reference].offset_s
        shift_s = ahead_s if abs(ahead_s) > CLOCKS_AGREE_S else 0.0
        if shift_s and sensor not in self._differing:
            self._differing.add(sensor)
            names = self._sensors[sensor].name, self._sensors[self._reference].name
            remedy = "sweeps are joined by their arrival, which is less exact; synchronise both by PTP or NTP"
            log.warning("the clocks of the sensors %s and %s differ by %.3f s: %s", *names, abs(ahead_s), remedy)
        # The steady time of each stream begins at its own first sweep, that of the frames at the first one of all.
        first_shift_s = received.arrived_s - self._began_s - sweep.time_s
        steady_s = sweep.time_s + self._steady_shift_s.setdefault(sensor, first_shift_s)
        return replace(sweep, stamp_s=sweep.stamp_s + shift_s, steady_s=steady_s)

    def _wait_for_arrival(self, timeout_s: float) -> None:
        with self._arrived:
            if not any(stream.has_news for k, stream in enumerate(self._streams) if k not in self._ended):
                self._arrived.wait(timeout_s)
