"""Live source that hands over the newest sweep, received by a separate thread."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from modt import host
from modt.errors import ModtError, ScanError
from modt.sources.packets.device_clock import DeviceClock
from modt.sources.scan_file import sanitised
from modt.sources.stamp_check import StampCheck
from modt.sources.stream import (
    Faults,
    Reading,
    Received,
    Reception,
    Stream,
    StreamEndedError,
    StreamInfo,
    Sweep,
    SweepReader,
    no_seconds,
    unit_of,
)
from modt.types import COMPENSATED, DESKEWED, Frame

log = logging.getLogger(__name__)

SILENT_S = 2.0
"""Time without a sweep after which a sensor is reported as silent [s]."""
READ_S = 0.2
"""Time that the receiving thread waits for a message before it checks for its end [s]."""
JITTER_S = 0.1
"""A larger change of the least stamp-to-arrival delay means that the stamps stepped [s]."""
PERIOD_GAIN = 0.05
"""Weight of a step between two sweeps in the mean period."""
MOST_PERIODS = 5.0
"""A longer step is a pause [nominal periods]."""
LATE_S = 1.0
"""Greatest age of a sweep or packet that is used [s]."""


@dataclass(frozen=True)
class Arrival:
    """A sweep as the receiving thread hands it over: its flaws, whether it can be used, and when it came [s]."""

    sweep: Sweep
    flaws: list[str]
    usable: bool
    arrived_s: float


class LiveStream:
    """Hands over the newest sweep; an older one that was not taken is dropped and counted.

    Attributes:
        info: properties of the stream, with n_frames None.
        faults: unusable sweeps and points.
        sweeps, incomplete, dropped: numbers of sweeps received, of sweeps with missing messages, and of sweeps that
            were not taken before a newer one or the end.
        skewed: number of sweeps that are deskewed by the times of a turn.
        silences: number of times that the sensor fell silent.
        period_s: mean time between the last sweeps by their stamps, at first the nominal one.
        arrived: notified of each sweep; streams that are not started may share one.
    """

    def __init__(
        self,
        info: StreamInfo,
        reader: SweepReader,
        *,
        cores: frozenset[int] | None = None,
        clock: Callable[[], float] = time.monotonic,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        """Read from a sensor in a thread of its own, once it is started.

        Args:
            info: properties of the stream.
            reader: source of its sweeps, which the stream closes.
            cores: cores of the receiving thread; None leaves it where it is started.
            clock: monotonic clock, which is read at arrivals and when a sweep is taken [s]. The waits for a sweep run
                on the system's own clock.
            pause: waits for a time [s] after a failed read.
        """
        self.info = info
        self.reader = reader
        self.faults = Faults()
        self.sweeps = 0
        self.incomplete = 0
        self.dropped = 0
        self.skewed = 0
        self.silences = 0
        self._cores = cores
        self._clock = clock
        self._pause = pause
        self.arrived = threading.Condition()
        self._newest: Arrival | None = None
        self._error: Exception | None = None
        self._ended = False
        self._silent = False
        self._await()
        self.period_s = info.period_s
        self._stamp_s = math.inf  # of the last sweep
        self._index = 0
        self._steady_s = 0.0
        self._delay = DeviceClock()
        self._check = StampCheck(live=True)
        self._thread = threading.Thread(target=self._receive, name="receiver", daemon=True)

    @property
    def profile(self) -> str | None:
        """Shipped profile of the sensor; None where there is none, or before its messages have identified it."""
        return self.info.profile or self.reader.profile

    def start(self) -> None:
        """Start receiving."""
        self._await()
        self._thread.start()

    def _await(self) -> None:
        """Begin to wait for the first sweep."""
        self._last_s = self._clock()  # arrival of the latest sweep
        self._looked_s = self._last_s  # when `take` last looked for one

    def take(self, timeout_s: float) -> Received | None:
        """Wait at most `timeout_s` for the newest sweep that was not taken; None without one.

        A sensor that is silent for SILENT_S is logged once, and once more when it returns. Unusable sweeps and sweeps
        with a doubtful stamp are counted and skipped.

        Raises:
            Exception: the error that ended the receiving thread, once the sweeps before it are taken.
        """
        with self.arrived:
            if self._newest is None and self._error is None:
                self.arrived.wait(timeout_s)
            if self._newest is None and self._error is not None:
                raise self._error
            taken = self._newest
            self._newest = None
        now_s = self._clock()
        if now_s - self._looked_s > timeout_s + LATE_S:  # this process was stopped, so the sensor is not blamed
            self._last_s = now_s
        self._looked_s = now_s
        if taken is None:
            if not self._silent and now_s - self._last_s > SILENT_S:
                self._silent = True
                self.silences += 1
                remedy = self.reader.reception.silence or "check its power, cable, address and port"
                remedy = f"{remedy}; tracks are kept until it returns"
                # The log takes lines of one format for one kind, so the name of the sensor is part of the format.
                name = self.info.name.replace("%", "%%")
                log.warning(f"{name}: no sweep for %.0f s; %s", SILENT_S, remedy)
            return None
        return self._frame(taken)

    @property
    def has_news(self) -> bool:
        """Whether `take` would return or raise at once; for those who hold `arrived`."""
        return self._newest is not None or self._error is not None

    @property
    def reading(self) -> Reading:
        """Counts of what was read so far."""
        reception = self.reader.reception
        times = Counter({DESKEWED: self.skewed, COMPENSATED: self.sweeps - self.skewed})
        return Reading(reception.messages, self.sweeps, reception.joined, +times, frame_id=reception.frame_id)

    def health(self) -> dict[str, Any]:
        """Counts for status and summary."""
        reception = self.reader.reception
        return {
            "messages": reception.messages,
            "lost_messages": reception.lost,
            "refused_messages": dict(reception.refused),
            "sweeps": self.sweeps,
            "incomplete_sweeps": self.incomplete,
            "dropped_sweeps": self.dropped,
            "silences": self.silences,
            "time_steps": self._check.steps,
            "silent": self._silent,
            "period_s": round(self.period_s, 4),
            "frame_id": reception.frame_id,
            "silence": reception.silence,
        }

    def close(self) -> None:
        """End the receiving thread and release the reader."""
        self._ended = True
        self.reader.close()
        if self._thread.is_alive():
            self._thread.join(2 * READ_S)
        with self.arrived:
            self.dropped += self._newest is not None
            self._newest = None

    def _receive(self) -> None:
        if refused := host.serve_loop(self._cores):
            log.warning("%s: %s", self.info.name, refused)
        while not self._ended and self._error is None:
            self._read()

    def _read(self) -> None:
        """Receive once; a failure of a message or of the system is counted, and reading goes on."""
        try:
            for sweep in self.reader.read(READ_S):
                self._put(sweep)
        except (StreamEndedError, ModtError) as error:
            with self.arrived:
                self._error = error
                self.arrived.notify()
        except Exception as error:
            if not self._ended and self.reader.reception.refuse(f"failed ({type(error).__name__})"):
                remedy = "check its network interface" if isinstance(error, OSError) else "report this"
                log.exception("%s: a message is left out: %s; later ones are counted", self.info.name, remedy)
            self._pause(0.001)  # leaves the CPU to others if each read fails

    def _put(self, sweep: Sweep) -> None:
        usable = True
        try:  # here, off the loop's thread
            _, flaws = sanitised(sweep.points, self.info.name)
        except ScanError as error:
            flaws = [error.cause]
            usable = False
        self._follow_period(sweep.stamp_s)
        with self.arrived:
            self.sweeps += 1
            self.incomplete += not sweep.complete
            self.dropped += self._newest is not None
            self.skewed += sweep.turn_s != 0
            self._newest = Arrival(sweep, flaws, usable, self._clock() - sweep.waited_s)
            self.arrived.notify()

    def _follow_period(self, stamp_s: float) -> None:
        """Follow the time between the sweeps, those included that nobody takes."""
        step_s = stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        if 0.0 < step_s < MOST_PERIODS * self.info.period_s:
            self.period_s += PERIOD_GAIN * (step_s - self.period_s)

    def _frame(self, taken: Arrival) -> Received | None:
        """The frame of a sweep; None if it cannot be used."""
        sweep = taken.sweep
        if self._silent:
            log.warning("%s: sweeps again after %.1f s", self.info.name, taken.arrived_s - self._last_s)
        self._silent = False
        self._last_s = max(self._last_s, taken.arrived_s)
        index = self._index if sweep.index is None else sweep.index
        self._index = index + 1
        doubt = self._doubt(sweep.stamp_s, taken.arrived_s)
        usable = taken.usable and not doubt
        if flaws := [doubt] if doubt else taken.flaws:
            self.faults.report(index, self.info.name, "; ".join(flaws), skipped=not usable)
        if not usable:
            return None
        frame = Frame(
            index,
            sweep.stamp_s,
            sweep.points,
            turn_s=sweep.turn_s,
            mid_rad=sweep.mid_rad,
            steady_s=self._steady_s,
            frame_id=sweep.frame_id,
            delay_s=sweep.delay_s,
        )
        return Received(frame, taken.arrived_s)

    def _doubt(self, stamp_s: float, arrived_s: float) -> str:
        """Reason why a sweep is refused, empty if it is not.

        Steady time advances by the stamps, or by the arrivals where the stamps step.
        """
        if (age_s := self._looked_s - arrived_s) > LATE_S:
            return f"taken {age_s:.1f} s after it came: this process was stopped, or has too little CPU time"
        if cause := no_seconds(stamp_s):
            return f"{cause}; have its driver write seconds"
        check = self._check
        steps = check.steps
        doubting = check.doubting
        before_s = self._delay.offset_s
        if doubt := check.doubt(stamp_s, arrived_s):
            return doubt
        if check.steps > steps:
            unit = unit_of(check.passed_s / check.waited_s) if check.waited_s else None
            why = f"are they in {unit}? have its driver write s" if unit else "a clock was set, or they come late"
            what = f"stamps have stepped by {check.passed_s - check.waited_s:+.3f} s against their arrival"
            log.warning("%s: %s: %s; they are followed", self.info.name, what, why)
        self._delay.unwrapped(stamp_s, arrived_s)
        stepped = doubting or abs(self._delay.offset_s - before_s) > JITTER_S
        self._steady_s += check.waited_s if stepped else check.passed_s
        return ""


@dataclass(slots=True)
class PlayedSince:
    """Begin of recordings that are played together.

    Attributes:
        start_s: time at which stamp 0 is due, by their clock [s]; None until one of them is read.
    """

    start_s: float | None = None


class PlayedReader:
    """Sweeps of a stream at the pace of their stamps, without their poses.

    Args:
        stream: the recording.
        loop: start over at its end, with stamps that go on.
        later_s: time by which it begins after others with the same `since` [s]; it is added to the stamps.
        since: shared by recordings that are played together; the first that is read sets it.
        clock: monotonic clock [s].
        wait: waits for a time [s]; returns True, possibly earlier, if the reader is closed.
    """

    profile = None  # the stream has it

    def __init__(
        self,
        stream: Stream,
        *,
        loop: bool = False,
        later_s: float = 0.0,
        since: PlayedSince | None = None,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], bool] | None = None,
    ) -> None:
        self.reception = Reception()
        self._stream = stream
        self._loop = loop
        self._closed = threading.Event()
        self._clock = clock
        self._wait = wait or self._closed.wait
        self._frames = _repeated(stream) if loop else ((frame.stamp_s, frame) for frame in stream)
        self._next: tuple[float, Frame] | None = None  # read before it is due
        self._later_s = later_s
        self._since = since or PlayedSince()

    def read(self, timeout_s: float) -> Sequence[Sweep]:
        """Next sweep, if it is due within the timeout."""
        self._next = self._next or next(self._frames, None)
        if self._next is None or self._closed.is_set():
            raise StreamEndedError
        played_s, frame = self._next
        stamp_s = played_s + self._later_s
        now_s = self._clock()
        if self._since.start_s is None:
            self._since.start_s = now_s - stamp_s
        due_s = self._since.start_s + stamp_s - now_s
        if due_s > 0 and (self._wait(min(due_s, timeout_s)) or due_s > timeout_s):
            return ()
        self._next = None
        self.reception.messages += 1
        if self._stream.faults.count:
            self.reception.refused["faulty scans"] = self._stream.faults.count
        index = None if self._loop else frame.index
        return (Sweep(stamp_s, frame.points, frame.turn_s, index=index, mid_rad=frame.mid_rad),)

    def close(self) -> None:
        """End a wait."""
        self._closed.set()


def _repeated(stream: Stream) -> Iterator[tuple[float, Frame]]:
    """Endless frames of a stream; stamps advance by one period from its end to its beginning."""
    played_s: float | None = None
    while True:
        offset_s: float | None = None
        for frame in stream:
            if offset_s is None:
                offset_s = 0.0 if played_s is None else played_s + stream.info.period_s - frame.stamp_s
            played_s = offset_s + frame.stamp_s
            yield played_s, frame
        if offset_s is None:
            return
