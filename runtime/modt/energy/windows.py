"""Windows of a second or more, at whose ends the meters are read."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from modt.energy.ledger import Clock, LedgerLine, StageWork
from modt.energy.meters.meter import Conditions, Kind, Meter, MeterLostError, Scope, worst
from modt.energy.readings import History, judge

SCHEMA = "modt.energy/1"


@dataclass(frozen=True)
class MeterEnergy:
    """Energy of a window by one of its meters [J], None where it is not measured."""

    name: str
    kind: Kind
    scope: Scope
    J: float | None


@dataclass(frozen=True, kw_only=True)
class EnergyWindow:
    """Energy and work of a window, a line modt.energy/1 of ledger.jsonl. Its fields are the keys of the line."""

    schema: str = SCHEMA
    window: int  # number of the window
    frames: tuple[int | None, int | None, int]  # first and last frame, and how many there are
    wall_ns: int  # exactly the sum of the stages' wall_ns, overhead_ns and idle_ns
    process_ns: int  # CPU time of all threads
    overhead_ns: int  # the ledger itself
    idle_ns: int  # waiting, and the loop
    stages: Mapping[str, StageWork]
    energy_J: float | None  # sum of the meters; None where one of them has not measured
    kind: Kind
    resolution_J: float
    meters: Sequence[MeterEnergy]
    conditions: Mapping[str, str | float | None]  # as Conditions.read
    marks: Sequence[str]  # marks of the readings (`judge`); "clock" as in the ledger; "suspended"

    @property
    def n_frames(self) -> int:
        """Number of frames that ended in the window."""
        return self.frames[2]

    @property
    def watts(self) -> float | None:
        """Mean power [W], None where the energy is not known."""
        if self.energy_J is None:
            return None
        return self.energy_J / (1e-9 * self.wall_ns) if self.wall_ns else 0.0

    @property
    def frame_J(self) -> float | None:
        """Mean energy a frame [J], None where it is not known."""
        return None if self.energy_J is None or not self.n_frames else self.energy_J / self.n_frames


@dataclass(frozen=True)
class Clocks:
    """The clocks of a machine."""

    monotonic_ns: Clock = time.monotonic_ns  # stops while the machine is suspended
    boot_ns: Clock = lambda: time.clock_gettime_ns(time.CLOCK_BOOTTIME)  # includes suspended time
    process_ns: Clock = time.process_time_ns  # CPU time of all threads


MIN_S = 1.0
"""Shortest window [s]. RAPL counters step every millisecond; INA chips and batteries average over longer times."""
SUSPEND_S = 0.2
"""A window in which the machine sleeps longer than this [s] is marked suspended and has no energy."""
PRIMING_S = 0.05
"""Length of the first window of a counter [s]. It has no energy, because no power is known yet to compare it with."""


class Windows:
    """Sums the lines of the ledger into windows, and reads the meters when a window closes."""

    def __init__(self, meters: Sequence[Meter], clocks: Clocks, conditions: Conditions, min_s: float = MIN_S) -> None:
        self._meters = meters
        self._histories = [History() for _ in meters]
        self._clocks = clocks
        self._conditions = conditions
        self._min_s = min_s
        has_counter = any(meter.facts.kind is Kind.MEASURED for meter in meters)
        self._least_s = min(PRIMING_S, min_s) if has_counter else min_s
        self._index = 0
        for k in range(len(meters)):
            self._read(k, 0.0)
        self._open()

    def add(self, line: LedgerLine) -> EnergyWindow | None:
        """Add a ledger line, and return the window if that closes, else None."""
        self._frames.append(line.frame)
        for stage, work in line.stages.items():
            self._stages[stage].add(work)
        self._overhead_ns += line.overhead_ns
        self._marks.update(line.marks)
        return self.close() if self._clocks.monotonic_ns() - self._begin_ns >= 1e9 * self._least_s else None

    def close(self) -> EnergyWindow:
        """Close the open window, however short, return it, and begin the next one."""
        # In the reverse order of _open: a process that stalls between the two readings does not look suspended.
        boot_ns = self._clocks.boot_ns() - self._boot_begin_ns
        wall_ns = self._clocks.monotonic_ns() - self._begin_ns
        suspended_ns = boot_ns - wall_ns
        suspended = suspended_ns > 1e9 * SUSPEND_S
        if suspended:
            self._marks.add("suspended")
        seconds = 1e-9 * (wall_ns + max(suspended_ns, 0))
        readings = [self._read(k, seconds) for k in range(len(self._meters))]
        self._marks.update(mark for _, mark in readings if mark)
        meters = [meter for meter, _ in readings]
        spans_ns = sum(work.wall_ns for work in self._stages.values())
        # A clock that ran backwards never makes a part of the window negative.
        if wall_ns < spans_ns + self._overhead_ns:
            self._marks.add("clock")
            wall_ns = spans_ns + self._overhead_ns
        joules = [meter.J for meter in meters if meter.J is not None]
        known = bool(meters) and len(joules) == len(meters) and not suspended
        frames = self._frames
        window = EnergyWindow(
            window=self._index,
            frames=(frames[0], frames[-1], len(frames)) if frames else (None, None, 0),
            wall_ns=wall_ns,
            process_ns=max(self._clocks.process_ns() - self._process_begin_ns, 0),
            overhead_ns=self._overhead_ns,
            idle_ns=wall_ns - spans_ns - self._overhead_ns,
            stages=self._stages,
            energy_J=sum(joules) if known else None,
            kind=worst(meter.kind for meter in meters) if known else Kind.UNAVAILABLE,
            resolution_J=sum((meter.facts.resolution_J(seconds) for meter in self._meters), 0.0),
            meters=meters,
            conditions=self._conditions.read(),
            marks=sorted(self._marks),
        )
        self._index += 1
        self._least_s = self._min_s
        self._open()
        return window

    def _read(self, k: int, seconds: float) -> tuple[MeterEnergy, str]:
        """Energy by meter k since its last reading, `seconds` ago, and the mark of the reading."""
        meter = self._meters[k]
        try:
            reading: float | None = meter.read()
        except MeterLostError:
            reading = None
        self._histories[k], energy_J, mark = judge(meter.facts, self._histories[k], reading, seconds)
        return MeterEnergy(meter.facts.name, meter.facts.kind, meter.facts.scope, energy_J), mark

    def _open(self) -> None:
        """Begin a window now."""
        self._begin_ns = self._clocks.monotonic_ns()
        self._boot_begin_ns = self._clocks.boot_ns()
        self._process_begin_ns = self._clocks.process_ns()
        self._frames: list[int] = []
        self._stages: defaultdict[str, StageWork] = defaultdict(StageWork)
        self._overhead_ns = 0
        self._marks: set[str] = set()
