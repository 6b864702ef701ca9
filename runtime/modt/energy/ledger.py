"""The ledger: times and counts what each stage does, frame by frame.

A span is one call of one stage. Spans do not nest, and all run on the thread that owns the ledger, so the parts of
a frame add up to it: the stages' spans, the ledger's own overhead and what is left (waiting, and the loop itself).
"""

from __future__ import annotations

import time
from collections.abc import Callable
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

    def run(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
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
        self._wall0, self._cpu0 = wall_ns(), cpu_ns()
        self.span_overhead_ns = self.frame_overhead_ns = 0
        self.span_overhead_ns, self.frame_overhead_ns = self._measure_overhead()
        self._wall0, self._cpu0 = wall_ns(), cpu_ns()

    def run(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args), booked on the stage; its items are len(result) where that has one."""
        wall0, cpu0 = self._wall_ns(), self._cpu_ns()
        try:
            result = function(*args, **kwargs)
        finally:
            cpu1, wall1 = self._cpu_ns(), self._wall_ns()
            row = self._stages.get(stage) or self._open(stage)
            row[_CALLS] += 1
            row[_WALL] += wall1 - wall0
            row[_CPU] += cpu1 - cpu0
        length = getattr(result, "__len__", None)
        if length is not None:
            row[_ITEMS] += length()
        return result

    def count(self, stage: str, *, items: int = 0, points: int = 0) -> None:
        """Books work on the stage that the length of its result does not tell."""
        row = self._stages.get(stage) or self._open(stage)
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
        marks: list[str] = []
        calls = spans = 0
        stages: dict[str, dict[str, int]] = {}
        for stage, row in rows.items():
            if row[_WALL] < 0 or row[_CPU] < 0:
                marks = ["clock"]
                row[_WALL], row[_CPU] = max(row[_WALL], 0), max(row[_CPU], 0)
            n, items, points, stage_wall, stage_cpu = row
            calls += n
            spans += stage_wall
            stages[stage] = {"calls": n, "items": items, "points": points, "wall_ns": stage_wall, "cpu_ns": stage_cpu}
        if frame_wall < spans or frame_cpu < 0:
            marks = ["clock"]
            frame_wall, frame_cpu = max(frame_wall, spans), max(frame_cpu, 0)
        overhead = min(calls * self.span_overhead_ns + self.frame_overhead_ns, frame_wall - spans)
        return {
            "schema": SCHEMA,
            "frame": index,
            "stages": stages,
            "wall_ns": frame_wall,
            "cpu_ns": frame_cpu,
            "overhead_ns": overhead,
            "idle_ns": frame_wall - spans - overhead,
            "marks": marks,
        }

    def _open(self, stage: str) -> list[int]:
        row = self._stages[stage] = [0, 0, 0, 0, 0]
        return row

    def _measure_overhead(self, spans: int = 32, rounds: int = 32) -> tuple[int, int]:
        """What a span costs beyond the call that it times, and a frame beyond its spans [ns]; the least seen."""
        least_span, least_frame = [], []
        for _ in range(rounds):
            t0 = self._cpu_ns()
            for _ in range(spans):
                _nothing()
            t1 = self._cpu_ns()
            for _ in range(spans):
                self.run("", _nothing)
            t2 = self._cpu_ns()
            self._stages = {stage: [0, 0, 0, 0, 0] for stage in STAGES}
            t3 = self._cpu_ns()
            self.close_frame(0)
            t4 = self._cpu_ns()
            least_span.append(max((t2 - t1) - (t1 - t0), 0) // spans)
            least_frame.append(max(t4 - t3, 0))
        return min(least_span), min(least_frame)


class NullLedger:
    """Books nothing."""

    def run(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args)."""
        return function(*args, **kwargs)

    def count(self, stage: str, *, items: int = 0, points: int = 0) -> None:
        """Nothing."""

    def close_frame(self, index: int) -> Line:
        """A line without stages."""
        return {"schema": SCHEMA, "frame": index, "stages": {}}


def _nothing() -> None:
    return None
