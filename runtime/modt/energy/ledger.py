"""The ledger: times and counts of each stage, frame by frame.

A span is one call of one stage. Spans do not nest, and all run on the thread of the ledger, so the parts sum to the
frame: the spans of the stages, the overhead of the ledger, and the rest (waiting, and the loop itself).
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

SCHEMA = "modt.ledger/1"
PIPELINE = ("segmentation", "odometry", "tracking", "scheduling", "classification", "fusion")
"""Stages whose cost is that of the pipeline; reading and writing depend on where frames come from and go to."""
STAGES = ("source", *PIPELINE, "sink")

ROUNDS = 32
"""Times that the overhead of a frame is measured, and number of spans in each."""

Clock = Callable[[], int]
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(slots=True)
class StageWork:
    """Work of one stage in a frame or a window."""

    calls: int = 0  # spans
    items: int = 0  # length of their results: points, proposals or tracks
    points: int = 0  # points that the network has processed
    wall_ns: int = 0
    cpu_ns: int = 0  # CPU time of the thread of the ledger

    def add(self, other: StageWork) -> None:
        """Add the work of another frame."""
        self.calls += other.calls
        self.items += other.items
        self.points += other.points
        self.wall_ns += other.wall_ns
        self.cpu_ns += other.cpu_ns


@dataclass(frozen=True, kw_only=True)
class LedgerLine:
    """The costs of a frame, a line modt.ledger/1 of ledger.jsonl. Its fields are the keys of the line."""

    schema: str = SCHEMA
    frame: int
    stages: Mapping[str, StageWork]  # of the stages that ran
    wall_ns: int  # exactly the sum of the stages' wall_ns, overhead_ns and idle_ns
    cpu_ns: int
    overhead_ns: int  # the ledger itself
    idle_ns: int  # waiting, and the loop
    marks: Sequence[str]  # "clock": a clock ran backwards, which counts as zero time


class Ledger:
    """Records wall time, CPU time of this thread, calls, items and points of every stage."""

    def __init__(self, wall_ns: Clock = time.perf_counter_ns, cpu_ns: Clock = time.thread_time_ns) -> None:
        self._wall_ns = wall_ns
        self._cpu_ns = cpu_ns
        self._stages: defaultdict[str, StageWork] = defaultdict(StageWork)
        self.span_overhead_ns = 0
        self.frame_overhead_ns = 0
        self._begin_frame(wall_ns(), cpu_ns())
        self.span_overhead_ns, self.frame_overhead_ns = self._measure_overhead()
        self._begin_frame(wall_ns(), cpu_ns())

    def run(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
        """Result of function(*args), timed as a span of the stage. Its items are len(result), if defined."""
        return self.timed(stage, function, *args, **kwargs)[0]

    def timed(self, stage: str, function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> tuple[R, int]:
        """Result as in `run`, and the CPU time of the span [ns]."""
        # The clock of the CPU is read inside the wall time, so that CPU time never exceeds it.
        wall_begin = self._wall_ns()
        cpu_begin = self._cpu_ns()
        try:
            result = function(*args, **kwargs)
        finally:
            cpu_end = self._cpu_ns()
            wall_end = self._wall_ns()
            work = self._stages[stage]
            work.calls += 1
            work.wall_ns += wall_end - wall_begin
            work.cpu_ns += cpu_end - cpu_begin
        length = getattr(result, "__len__", None)
        if length is not None:
            work.items += length()
        return result, cpu_end - cpu_begin

    def count(self, stage: str, *, points: int) -> None:
        """Add points to the work of the stage."""
        self._stages[stage].points += points

    def close_frame(self, index: int) -> LedgerLine:
        """Line of the frame: its stages, and the parts of the time since the last line."""
        wall_end = self._wall_ns()
        cpu_end = self._cpu_ns()
        wall_ns = wall_end - self._wall_begin
        cpu_ns = cpu_end - self._cpu_begin
        stages = dict(self._stages)
        self._begin_frame(wall_end, cpu_end)
        backwards = False
        for work in stages.values():
            backwards |= work.wall_ns < 0 or work.cpu_ns < 0
            work.wall_ns = max(work.wall_ns, 0)
            work.cpu_ns = max(work.cpu_ns, 0)
        calls = sum(work.calls for work in stages.values())
        spans_ns = sum(work.wall_ns for work in stages.values())
        backwards |= wall_ns < spans_ns or cpu_ns < 0
        wall_ns = max(wall_ns, spans_ns)
        overhead_ns = min(calls * self.span_overhead_ns + self.frame_overhead_ns, wall_ns - spans_ns)
        return LedgerLine(
            frame=index,
            stages=stages,
            wall_ns=wall_ns,
            cpu_ns=max(cpu_ns, 0),
            overhead_ns=overhead_ns,
            idle_ns=wall_ns - spans_ns - overhead_ns,
            marks=["clock"] if backwards else [],
        )

    def _begin_frame(self, wall_ns: int, cpu_ns: int) -> None:
        self._wall_begin = wall_ns
        self._cpu_begin = cpu_ns
        self._stages = defaultdict(StageWork)

    def _measure_overhead(self) -> tuple[int, int]:
        """CPU time of a span beyond the timed call, and of a frame beyond its spans [ns], the least of the rounds.

        It counts as wall time: unlike that, it does not grow while other processes run.
        """
        span_ns = []
        frame_ns = []
        for _ in range(ROUNDS):
            start = self._cpu_ns()
            for _ in range(ROUNDS):
                _nothing()
            called = self._cpu_ns()
            for _ in range(ROUNDS):
                self.run("", _nothing)
            timed = self._cpu_ns()
            self._stages.update({stage: StageWork() for stage in STAGES})
            filled = self._cpu_ns()
            self.close_frame(0)
            closed = self._cpu_ns()
            span_ns.append(max((timed - called) - (called - start), 0) // ROUNDS)
            frame_ns.append(max(closed - filled, 0))
        return min(span_ns), min(frame_ns)


def _nothing() -> None:
    return None
