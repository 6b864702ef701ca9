"""The modes on the same stream, interleaved, so that other load of the machine affects all of them equally."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from itertools import islice

import numpy as np

from modt.classes import ObjectClass
from modt.energy.ledger import Ledger, LedgerLine, StageWork
from modt.energy.windows import EnergyWindow, Windows
from modt.pipeline import CLASSIFICATION, STAGES, FusionStage, Pipeline
from modt.reporting.histogram import Histogram
from modt.types import NONE, Bool, Budget, Evidence, Float64, Frame, FrameResult, Int, Motion, Proposals
from modt_profiling.energy.savings import Counts

COUNTS = tuple(f.name for f in fields(Counts) if f.name != "frames")
"""Columns of a run's counts."""


class RecordingFusion:
    """A fusion that records which tracks have asked for a class."""

    def __init__(self, fusion: FusionStage) -> None:
        self.observe = fusion.observe
        self.fuse = fusion.fuse
        self._asks = fusion.asks
        self._asked: set[int] = set()
        self._known: set[int] = set()

    def asks(self, evidence: Evidence, motion: Motion, proposals: Proposals, wants_class: Bool) -> Bool:
        """(M,) tracks whose view is worth a classification."""
        asks = self._asks(evidence, motion, proposals, wants_class)
        self._asked.update(motion.id[asks].tolist())
        return asks

    def first_asked(self, alive: set[int]) -> int:
        """Number of tracks that asked for the first time since the last call; only tracks alive are remembered."""
        number = len(self._asked - self._known)
        self._known = (self._known | self._asked) & alive
        self._asked = set()
        return number


@dataclass
class ModeRun:
    """One pass of one mode through the stream."""

    pipeline: Pipeline
    ledger: Ledger
    budget: Callable[[int], Budget]  # budget of a frame by its index
    windows: Windows | None = None  # None where no meter is read
    lines: list[LedgerLine] = field(default_factory=list)  # lines of the ledger
    energy_lines: list[EnergyWindow] = field(default_factory=list)
    lengths: Histogram = field(default_factory=Histogram)  # frames with a proposal of every track that has ended
    _counts: list[tuple[int, ...]] = field(default_factory=list)
    _alive: dict[int, int] = field(default_factory=dict)  # the same of the tracks alive
    _classified: set[int] = field(default_factory=set)
    _seen: set[int] = field(default_factory=set)

    def step(self, frame: Frame) -> None:
        """Process one frame; counting happens between the frames of the ledger."""
        result = self.pipeline.step(frame, self.budget(frame.index))
        line = self.ledger.close_frame(frame.index)
        self.lines.append(line)
        self._count(result, line)
        if self.windows is not None:
            closed = self.windows.add(line)
            if closed is not None:
                self.energy_lines.append(closed)

    def begin_turn(self) -> None:
        """Discard the time and energy of other modes since the last turn."""
        self.ledger.close_frame(-1)
        if self.windows is not None:
            self.windows.close()

    def end_turn(self) -> None:
        """Read the meters at the end of a turn."""
        if self.windows is not None:
            self.energy_lines.append(self.windows.close())

    def finish(self) -> None:
        """Count the length of the tracks that are alive at the end of the stream."""
        self._end(self._alive.keys())

    def counts(self) -> Int:
        """(frames, columns) counts of each frame, columns as COUNTS."""
        return np.array(self._counts, np.int64).reshape(-1, len(COUNTS))

    def cpu_s(self) -> Float64:
        """(frames, stages) CPU time of each stage of the pipeline [s]."""
        rows = [[line.stages.get(stage, StageWork()).cpu_ns for stage in STAGES] for line in self.lines]
        return 1e-9 * np.array(rows, float).reshape(-1, len(STAGES))

    def _end(self, ids: Iterable[int]) -> None:
        for id_ in ids:
            self.lengths.add(self._alive[id_])

    def _count(self, result: FrameResult, line: LedgerLine) -> None:
        tracks = result.tracks
        work = line.stages.get(CLASSIFICATION, StageWork())
        visible = tracks.proposal != NONE
        alive, seen, classified = (set(ids.tolist()) for ids in (tracks.id, tracks.id[visible], result.classified))
        self._counts.append(
            (
                len(result.proposals),
                int((visible & (tracks.object_class != ObjectClass.BACKGROUND)).sum()),
                len(alive - self._alive.keys()),
                len(classified - self._classified),
                len(result.classified),
                len((classified & self._classified) - self._seen),
                work.points,
                work.calls,
                len(result.frame.points),
                len(tracks.id),
            )
        )
        self._end(self._alive.keys() - alive)
        self._alive = {id_: self._alive.get(id_, 0) + (id_ in seen) for id_ in alive}
        self._classified = (self._classified | classified) & alive
        self._seen = seen


Repetition = dict[str, ModeRun]
"""One pass of every mode through the stream, by the name of the mode."""


def interleave(
    stream: Iterable[Frame], runs: Sequence[ModeRun], turn: int, end_turn: Callable[[], None] = lambda: None
) -> None:
    """Process every frame by every run, `turn` frames at a time, with the first run rotating.

    `end_turn` is called between two turns, when nothing is measured.
    """
    gc.collect()
    gc.freeze()
    frames = iter(stream)
    first = 0
    while block := list(islice(frames, turn)):
        for run in (*runs[first:], *runs[:first]):
            run.begin_turn()
            for frame in block:
                run.step(frame)
            run.end_turn()
            end_turn()
        first = (first + 1) % len(runs)
    for run in runs:
        run.finish()


def total(counts: Int) -> Counts:
    """Sums over the frames of (frames, columns) counts."""
    return Counts(len(counts), **dict(zip(COUNTS, counts.sum(axis=0).tolist(), strict=True)))
