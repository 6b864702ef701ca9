"""The ledger: times and counts what each stage does, frame by frame.

A span is one call of one stage. Spans do not nest, and all run on the thread that owns the ledger, so the parts of
a frame add up to it: the stages' spans, the ledger's own overhead and what is left (waiting, and the loop itself).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sized
from typing import Any, ParamSpec, Protocol, TypeVar

SCHEMA = "modt.ledger/1"
STAGES = ("source", "segmentation", "tracking", "scheduling", "classification", "fusion", "sink")

Clock = Callable[[], int]
Line = dict[str, Any]
P = ParamSpec("P")
R = TypeVar("R")

_CALLS, _ITEMS, _POINTS, _WALL, _CPU = range(5)


class StageLedger(Protocol):
    """What the pipeline asks of a ledger."""

    def run(self, stage: str, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args), booked on the stage."""
        ...

    def count(self, stage: str, *, items: int = 0, points: int = 0) -> None:
        """Books work on the stage that the length of its result does not tell."""
        ...

    def close_frame(self, index: int) -> Line:
        """The frame's line; the next frame begins."""
        ...


class Ledger:
    """Books wall time, CPU time of this thread, calls, items and points of every stage.

    Args:
        wall_ns: monotonic clock [ns].
        cpu_ns: CPU time of the calling thread [ns].
    """

    def __init__(self, wall_ns: Clock = time.perf_counter_ns, cpu_ns: Clock = time.thread_time_ns) -> None:
        self._wall_ns, self._cpu_ns = wall_ns, cpu_ns
        self._stages: dict[str, list[int]] = {}
        self._marks: list[str] = []
        self.span_overhead_ns = self._measure_overhead()
        self._wall0, self._cpu0 = wall_ns(), cpu_ns()

    def run(self, stage: str, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args), booked on the stage; its items are len(result) where that has one."""
        wall, cpu = self._wall_ns(), self._cpu_ns()
        try:
            result = function(*args, **kwargs)
        finally:
            cpu, wall = self._cpu_ns() - cpu, self._wall_ns() - wall
            row = self._stages.setdefault(stage, [0, 0, 0, 0, 0])
            row[_CALLS] += 1
            row[_WALL] += wall
            row[_CPU] += cpu
        if isinstance(result, Sized):
            row[_ITEMS] += len(result)
        return result

    def count(self, stage: str, *, items: int = 0, points: int = 0) -> None:
        """Books work on the stage that the length of its result does not tell."""
        row = self._stages.setdefault(stage, [0, 0, 0, 0, 0])
        row[_ITEMS] += items
        row[_POINTS] += points

    def close_frame(self, index: int) -> Line:
        """The frame's line: its stages, and the parts of the time since the last line.

        wall_ns = sum of the stages' wall_ns + overhead_ns + idle_ns holds exactly. A clock that ran backwards is
        marked "clock" and counts as no time, never as negative time.
        """
        wall, cpu = self._wall_ns(), self._cpu_ns()
        frame_wall, frame_cpu = wall - self._wall0, cpu - self._cpu0
        self._wall0, self._cpu0 = wall, cpu
        rows, self._stages = self._stages, {}
        marks, self._marks = self._marks, []
        spans = sum(row[_WALL] for row in rows.values())
        if frame_cpu < 0 or frame_wall < spans or any(row[_WALL] < 0 or row[_CPU] < 0 for row in rows.values()):
            marks.append("clock")
            for row in rows.values():
                row[_WALL], row[_CPU] = max(row[_WALL], 0), max(row[_CPU], 0)
            spans = sum(row[_WALL] for row in rows.values())
            frame_wall, frame_cpu = max(frame_wall, spans), max(frame_cpu, 0)
        calls = sum(row[_CALLS] for row in rows.values())
        overhead = min(calls * self.span_overhead_ns, frame_wall - spans)
        return {
            "schema": SCHEMA,
            "frame": index,
            "stages": {stage: _booked(row) for stage, row in rows.items()},
            "wall_ns": frame_wall,
            "cpu_ns": frame_cpu,
            "overhead_ns": overhead,
            "idle_ns": frame_wall - spans - overhead,
            "marks": marks,
        }

    def _measure_overhead(self, spans: int = 256, rounds: int = 8) -> int:
        """What one span costs beyond the call that it times [ns]; the least of a few rounds."""
        least = None
        for _ in range(rounds):
            start = self._cpu_ns()
            for _ in range(spans):
                self.run("", _nothing)
            booked = self._cpu_ns() - start
            start = self._cpu_ns()
            for _ in range(spans):
                _nothing()
            plain = self._cpu_ns() - start
            cost = max(booked - plain, 0) // spans
            least = cost if least is None else min(least, cost)
        self._stages.clear()
        return least or 0


class NullLedger:
    """Books nothing."""

    def run(self, stage: str, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args)."""
        return function(*args, **kwargs)

    def count(self, stage: str, *, items: int = 0, points: int = 0) -> None:
        """Nothing."""

    def close_frame(self, index: int) -> Line:
        """A line without stages."""
        return {"schema": SCHEMA, "frame": index, "stages": {}}


def _booked(row: list[int]) -> dict[str, int]:
    calls, items, points, wall, cpu = row
    return {"calls": calls, "items": items, "points": points, "wall_ns": wall, "cpu_ns": cpu}


def _nothing() -> None:
    return None
