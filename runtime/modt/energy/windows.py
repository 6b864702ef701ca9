"""Windows of a second or more, at whose ends the meters are read."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from modt.energy.ledger import Clock, Line
from modt.energy.meters.meter import Conditions, Kind, Meter, MeterLostError, worst
from modt.energy.readings import History, judge

SCHEMA = "modt.energy/1"


@dataclass(frozen=True, slots=True)
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
        self._meters, self._histories = meters, [History() for _ in meters]
        self._clocks, self._conditions, self._min_s = clocks, conditions, min_s
        self._index = 0
        self._least_s = min(PRIMING_S, min_s) if any(m.facts.kind is Kind.MEASURED for m in meters) else min_s
        for k in range(len(meters)):
            self._advance(k, 0.0)
        self._open()

    def add(self, line: Line) -> Line | None:
        """Add a ledger line, and return the line of the window if that closes, else None."""
        self._frames.append(line["frame"])
        for stage, row in line["stages"].items():
            self._stages[stage].update(row)
        self._overhead_ns += line["overhead_ns"]
        if "clock" in line["marks"]:
            self._marks.append("clock")
        return self.close() if self._clocks.monotonic_ns() - self._start_ns >= 1e9 * self._least_s else None

    def close(self) -> Line:
        """Close the open window, however short, return its line, and begin the next one.

        The stages' wall_ns, overhead_ns and idle_ns sum to wall_ns exactly.
        """
        clocks, marks, frames = self._clocks, self._marks, self._frames
        wall_ns = clocks.monotonic_ns() - self._start_ns
        suspended_ns = clocks.boot_ns() - self._boot0_ns - wall_ns
        suspended = suspended_ns > 1e9 * SUSPEND_S
        if suspended:
            marks.append("suspended")
        seconds = 1e-9 * (wall_ns + max(suspended_ns, 0))
        readings: list[dict[str, Any]] = []
        resolution_J = 0.0
        for k, meter in enumerate(self._meters):
            energy_J, mark = self._advance(k, seconds)
            marks += [mark] if mark else []
            facts = meter.facts
            readings.append({"name": facts.name, "kind": facts.kind.value, "scope": facts.scope.value, "J": energy_J})
            resolution_J += facts.resolution * (1.0 if facts.counts else seconds)
        spans_ns = sum(row["wall_ns"] for row in self._stages.values())
        if wall_ns < spans_ns + self._overhead_ns:
            marks.append("clock")
            wall_ns = spans_ns + self._overhead_ns
        energies = [r["J"] for r in readings]
        known = bool(energies) and None not in energies and not suspended
        line: Line = {
            "schema": SCHEMA,
            "window": self._index,
            "frames": [frames[0], frames[-1], len(frames)] if frames else [None, None, 0],
            "wall_ns": wall_ns,
            "process_ns": max(clocks.process_ns() - self._process0_ns, 0),
            "overhead_ns": self._overhead_ns,
            "idle_ns": wall_ns - spans_ns - self._overhead_ns,
            "stages": self._stages,
            "energy_J": sum(energies) if known else None,
            "kind": worst(Kind(r["kind"]) for r in readings).value if known else Kind.UNAVAILABLE.value,
            "resolution_J": resolution_J,
            "meters": readings,
            "conditions": self._conditions.read(),
            "marks": sorted(set(marks)),
        }
        self._index, self._least_s = self._index + 1, self._min_s
        self._open()
        return line

    def _advance(self, k: int, seconds: float) -> tuple[float | None, str]:
        """Energy since the last reading of a meter [J], None where it is not measured, and its mark."""
        meter = self._meters[k]
        try:
            reading: float | None = meter.read()
        except MeterLostError:
            reading = None
        self._histories[k], energy_J, mark = judge(meter.facts, self._histories[k], reading, seconds)
        return energy_J, mark

    def _open(self) -> None:
        clocks = self._clocks
        self._start_ns, self._boot0_ns = clocks.monotonic_ns(), clocks.boot_ns()
        self._process0_ns = clocks.process_ns()
        self._frames: list[int] = []
        self._stages: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self._overhead_ns = 0
        self._marks: list[str] = []
