"""The ledger: times and counts of each stage, frame by frame.

A span is one call of one stage. Spans do not nest, and all run on the thread of the ledger, so the parts sum to the
frame: the spans of the stages, the overhead of the ledger, and the rest (waiting, and the loop itself).
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

SCHEMA = "modt.ledger/1"
STAGES = ("source", "segmentation", "odometry", "tracking", "scheduling", "classification", "fusion", "sink")

Clock = Callable[[], int]
Line = dict[str, Any]
P = ParamSpec("P")
R = TypeVar("R")

NO_WORK = {"calls": 0, "items": 0, "points": 0, "wall_ns": 0, "cpu_ns": 0}
"""Row of a stage that has not run."""


class Ledger:
    """Records wall time, CPU time of this thread, calls, items and points of every stage."""

    def __init__(self, wall_ns: Clock = time.perf_counter_ns, cpu_ns: Clock = time.thread_time_ns) -> None:
        self._wall_ns, self._cpu_ns = wall_ns, cpu_ns
        self._stages = defaultdict[str, dict[str, int]](NO_WORK.copy)
        self._wall0, self._cpu0 = wall_ns(), cpu_ns()
        self.span_overhead_ns = self.frame_overhead_ns = 0
        self.span_overhead_ns, self.frame_overhead_ns = self._measure_overhead()
        self._wall0, self._cpu0 = wall_ns(), cpu_ns()

    def run(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args), timed as a span of the stage. Its items are len(result), if defined."""
        return self.timed(stage, function, *args, **kwargs)[0]

    def timed(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> tuple[R, int]:
        """Result as in `run`, and the CPU time of the span [ns]."""
        wall0, cpu0 = self._wall_ns(), self._cpu_ns()
        try:
            result = function(*args, **kwargs)
        finally:
            cpu1, wall1 = self._cpu_ns(), self._wall_ns()
            row = self._stages[stage]
            row["calls"] += 1
            row["wall_ns"] += wall1 - wall0
            row["cpu_ns"] += cpu1 - cpu0
        length = getattr(result, "__len__", None)
        if length is not None:
            row["items"] += length()
        return result, cpu1 - cpu0

    def count(self, stage: str, *, points: int) -> None:
        """Add points to the work of the stage."""
        self._stages[stage]["points"] += points

    def close_frame(self, index: int) -> Line:
        """Line of the frame: its stages, and the parts of the time since the last line.

        The stages' wall_ns, overhead_ns and idle_ns sum to wall_ns exactly. A clock that ran backwards is marked
        "clock" and counts as zero time.
        """
        wall, cpu = self._wall_ns(), self._cpu_ns()
        frame_wall, frame_cpu = wall - self._wall0, cpu - self._cpu0
        self._wall0, self._cpu0 = wall, cpu
        rows, self._stages = dict(self._stages), defaultdict(NO_WORK.copy)
        marks: list[str] = []
        for row in rows.values():
            if row["wall_ns"] < 0 or row["cpu_ns"] < 0:
                marks = ["clock"]
                row["wall_ns"], row["cpu_ns"] = max(row["wall_ns"], 0), max(row["cpu_ns"], 0)
        calls, spans = (sum(row[key] for row in rows.values()) for key in ("calls", "wall_ns"))
        if frame_wall < spans or frame_cpu < 0:
            marks = ["clock"]
            frame_wall, frame_cpu = max(frame_wall, spans), max(frame_cpu, 0)
        overhead = min(calls * self.span_overhead_ns + self.frame_overhead_ns, frame_wall - spans)
        return {
            "schema": SCHEMA,
            "frame": index,
            "stages": rows,
            "wall_ns": frame_wall,
            "cpu_ns": frame_cpu,
            "overhead_ns": overhead,
            "idle_ns": frame_wall - spans - overhead,
            "marks": marks,
        }

    def _measure_overhead(self, spans: int = 32, rounds: int = 32) -> tuple[int, int]:
        """Cost of a span beyond the timed call, and of a frame beyond its spans [ns], the least of the rounds."""
        span_ns, frame_ns = [], []
        for _ in range(rounds):
            t0 = self._cpu_ns()
            for _ in range(spans):
                _nothing()
            t1 = self._cpu_ns()
            for _ in range(spans):
                self.run("", _nothing)
            t2 = self._cpu_ns()
            self._stages.update({stage: NO_WORK.copy() for stage in STAGES})
            t3 = self._cpu_ns()
            self.close_frame(0)
            t4 = self._cpu_ns()
            span_ns.append(max((t2 - t1) - (t1 - t0), 0) // spans)
            frame_ns.append(max(t4 - t3, 0))
        return min(span_ns), min(frame_ns)


def _nothing() -> None:
    return None
