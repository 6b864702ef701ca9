"""Windows of a second or more: the only edges at which meters are read."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from modt.energy.conditions import Conditions
from modt.energy.meters.meter import Kind, Meter, MeterLostError, Quantity

SCHEMA = "modt.energy/1"
SUSPEND_S = 0.2
"""Time by which the clocks that run on in sleep may lead the one that does not, before it counts as sleep."""
CLOCK_STEP_S = 0.5
"""Jump of the wall calendar against the monotonic clock that is reported."""

Line = dict[str, Any]


def _boot_ns() -> int:
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


@dataclass(frozen=True, slots=True)
class Clocks:
    """The clocks of a machine [ns].

    Attributes:
        monotonic_ns: stands still while the machine is suspended.
        boot_ns: runs on meanwhile.
        calendar_ns: may be set.
        process_ns: CPU time of all threads of this process.
    """

    monotonic_ns: Callable[[], int] = time.monotonic_ns
    boot_ns: Callable[[], int] = _boot_ns
    calendar_ns: Callable[[], int] = time.time_ns
    process_ns: Callable[[], int] = time.process_time_ns


class Tape:
    """Turns the readings of one meter into energy between readings; never negative, never silently wrong."""

    def __init__(self, meter: Meter) -> None:
        self.meter = meter
        self._last: float | None = None
        self._lost = False

    def advance(self, seconds: float, *, suspended: bool = False) -> tuple[float | None, list[str]]:
        """Energy since the last reading [J], None where it is not known, and marks that say what happened.

        Marks: "lost" (unreadable), "back" (readable again), "wrap" (counter passed its range), "reset" (counter
        went back for no known reason), "implausible" (more than the meter could show), "ambiguous" (long enough for
        a whole turn of the counter), "negative" (power below zero, taken as zero).
        """
        before = self._last
        try:
            now = self.meter.read()
        except MeterLostError:
            self._last, self._lost = None, True
            return None, ["lost"]
        self._last = now
        if before is None:
            marks = ["back"] if self._lost else []
            self._lost = False
            return None, marks
        if self.meter.facts.quantity is Quantity.POWER:
            return self._integrated(before, now, seconds, suspended)
        return self._counted(before, now, seconds)

    def _integrated(
        self, before: float, now: float, seconds: float, suspended: bool
    ) -> tuple[float | None, list[str]]:
        if suspended:
            return None, []
        if max(before, now) > self.meter.facts.max_W:
            return None, ["implausible"]
        marks = ["negative"] if min(before, now) < 0 else []
        return 0.5 * (max(before, 0.0) + max(now, 0.0)) * seconds, marks

    def _counted(self, before: float, now: float, seconds: float) -> tuple[float | None, list[str]]:
        facts = self.meter.facts
        energy_J, marks = now - before, list[str]()
        if energy_J < 0:
            if facts.wrap_J is None:
                return None, ["reset"]
            energy_J, marks = energy_J + facts.wrap_J, ["wrap"]
        if facts.wrap_J is not None and seconds * facts.max_W >= facts.wrap_J:
            return None, [*marks, "ambiguous"]
        if not 0 <= energy_J <= seconds * facts.max_W + facts.resolution:
            return None, ["reset" if marks else "implausible"]
        return energy_J, marks


class Windows:
    """Adds up the ledger's lines and closes a window over them whenever enough time has passed.

    Args:
        meters: to be added up; none of them counts what another one counts.
        clocks: of this machine.
        conditions: governor, frequency, temperature.
        least_s: shortest window [s].
    """

    def __init__(self, meters: Sequence[Meter], clocks: Clocks, conditions: Conditions, least_s: float = 1.0) -> None:
        self._tapes = [Tape(meter) for meter in meters]
        self._clocks, self._conditions, self._least_ns = clocks, conditions, round(least_s * 1e9)
        self._index = 0
        for tape in self._tapes:
            tape.advance(0.0)
        self._open()

    def add(self, line: Line) -> Line | None:
        """Books a ledger line; the window's line when it is time to close it, else None."""
        self._frames.append(line["frame"])
        for stage, row in line["stages"].items():
            total = self._stages.setdefault(stage, dict.fromkeys(row, 0))
            for key, value in row.items():
                total[key] += value
        self._overhead_ns += line["overhead_ns"]
        if "clock" in line["marks"]:
            self._marks.append("clock")
        return self.close() if self._clocks.monotonic_ns() - self._start_ns >= self._least_ns else None

    def close(self) -> Line:
        """The line of the window in hand, however short; the next begins.

        wall_ns = sum of the stages' wall_ns + overhead_ns + idle_ns holds exactly.
        """
        clocks = self._clocks
        wall_ns = clocks.monotonic_ns() - self._start_ns
        slept_ns = clocks.boot_ns() - self._boot0_ns - wall_ns
        stepped_ns = clocks.calendar_ns() - self._calendar0_ns - wall_ns - max(slept_ns, 0)
        marks = self._marks
        suspended = slept_ns > SUSPEND_S * 1e9
        if suspended:
            marks.append("suspended")
        if abs(stepped_ns) > CLOCK_STEP_S * 1e9:
            marks.append("clock-step")
        seconds = 1e-9 * (wall_ns + max(slept_ns, 0))
        readings = []
        for tape in self._tapes:
            energy_J, said = tape.advance(seconds, suspended=suspended)
            marks += said
            facts = tape.meter.facts
            readings.append({"name": facts.name, "kind": facts.kind.value, "scope": facts.scope.value, "J": energy_J})
        spans_ns = sum(row["wall_ns"] for row in self._stages.values())
        if wall_ns < spans_ns + self._overhead_ns:
            marks.append("clock")
            wall_ns = spans_ns + self._overhead_ns
        energies = [r["J"] for r in readings]
        known = bool(energies) and None not in energies and not suspended
        line: Line = {
            "schema": SCHEMA,
            "window": self._index,
            "frames": [self._frames[0], self._frames[-1], len(self._frames)] if self._frames else [None, None, 0],
            "wall_ns": wall_ns,
            "process_ns": max(clocks.process_ns() - self._process0_ns, 0),
            "overhead_ns": self._overhead_ns,
            "idle_ns": wall_ns - spans_ns - self._overhead_ns,
            "stages": self._stages,
            "energy_J": sum(energies) if known else None,
            "kind": readings[0]["kind"] if known else Kind.UNAVAILABLE.value,
            "resolution_J": self._resolution_J(seconds),
            "meters": readings,
            "conditions": self._conditions.read(),
            "marks": sorted(set(marks)),
        }
        self._index += 1
        self._open()
        return line

    def _resolution_J(self, seconds: float) -> float:
        """Error that the steps of the readings alone can make [J]."""
        facts = [tape.meter.facts for tape in self._tapes]
        return sum(f.resolution * (seconds if f.quantity is Quantity.POWER else 1.0) for f in facts)

    def _open(self) -> None:
        clocks = self._clocks
        self._start_ns, self._boot0_ns = clocks.monotonic_ns(), clocks.boot_ns()
        self._calendar0_ns, self._process0_ns = clocks.calendar_ns(), clocks.process_ns()
        self._frames: list[int] = []
        self._stages: dict[str, dict[str, int]] = {}
        self._overhead_ns = 0
        self._marks: list[str] = []
