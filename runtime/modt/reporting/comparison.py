"""The modes on the same stream, interleaved, so that other load of the machine affects all of them equally."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from modt.classes import ObjectClass
from modt.energy.ledger import Ledger
from modt.energy.savings import Counts
from modt.energy.windows import Windows
from modt.pipeline import CLASSIFICATION, STAGES, Classifier, Pipeline
from modt.types import NONE, Bool, Budget, Float32, Float64, Frame, FrameResult, Int, Proposals

COUNTS = ("proposals", "foreground", "tracks", "classified_tracks", "classified", "reacquired", "points", "calls")
"""Columns of a run's counts, as in energy.savings.Counts."""


class RecordingClassifier:
    """A classifier that records the proposals of its last call.

    Attributes:
        rows: (R,) proposals classified by the last call.
    """

    def __init__(self, classifier: Classifier) -> None:
        self._classifier = classifier
        self.facts = classifier.facts
        self.clear()

    def clear(self) -> None:
        """Forget the last call."""
        self.rows: Int = np.zeros(0, np.int64)

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the R proposals given by index."""
        self.rows = which
        return self._classifier.classify(points, proposals, which)


@dataclass(frozen=True, slots=True)
class TrackHistory:
    """History of a track that is alive.

    Attributes:
        classified: at least once.
        seen: with a proposal in the last frame.
        life: frames with a proposal.
    """

    classified: bool = False
    seen: bool = True
    life: int = 0


@dataclass
class ModeRun:
    """One pass of one mode through the stream.

    Attributes:
        pipeline: its stages, with the recorder as classifier.
        ledger: of the pipeline.
        recorder: the classifier.
        budget: of the frame with that index.
        windows: over the meters, None where modes share a window.
        lines: ledger lines.
        energy_lines: windows closed.
        lives: frames with a proposal, of every track that ended.
    """

    pipeline: Pipeline
    ledger: Ledger
    recorder: RecordingClassifier
    budget: Callable[[int], Budget]
    windows: Windows | None = None
    lines: list[dict[str, Any]] = field(default_factory=list)
    energy_lines: list[dict[str, Any]] = field(default_factory=list)
    lives: list[int] = field(default_factory=list)
    _counts: list[tuple[int, ...]] = field(default_factory=list)
    _alive: dict[int, TrackHistory] = field(default_factory=dict)

    def step(self, frame: Frame) -> None:
        """Process one frame; counting happens between the frames of the ledger."""
        self.recorder.clear()
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
        """Count the lives of the tracks still alive at the end of the stream."""
        self.lives += [track.life for track in self._alive.values()]

    def counts(self) -> Int:
        """(frames, 8) counts of each frame, columns as COUNTS."""
        return np.array(self._counts, np.int64).reshape(-1, len(COUNTS))

    def cpu_s(self) -> Float64:
        """(frames, stages) CPU time of each stage of the pipeline [s]."""
        rows = [[line["stages"].get(s, {}).get("cpu_ns", 0) for s in STAGES] for line in self.lines]
        return 1e-9 * np.array(rows, float).reshape(-1, len(STAGES))

    def _count(self, result: FrameResult, line: dict[str, Any]) -> None:
        tracks = result.tracks
        seen = tracks.proposal != NONE
        classified = np.zeros(len(tracks), np.bool_)
        classified[tracks.row_of_proposal(len(result.proposals))[self.recorder.rows]] = True
        new, first, reacquired = self._update_histories(tracks.id, seen, classified)
        foreground = seen & (tracks.object_class != ObjectClass.BACKGROUND)
        row = line["stages"].get(CLASSIFICATION, {})
        self._counts.append(
            (
                len(result.proposals),
                int(foreground.sum()),
                new,
                first,
                result.n_classified,
                reacquired,
                row.get("points", 0),
                row.get("calls", 0),
            )
        )

    def _update_histories(self, ids: Int, seen: Bool, classified: Bool) -> tuple[int, int, int]:
        """Update the histories; returns the tracks new, first classified, and classified again after a loss."""
        alive: dict[int, TrackHistory] = {}
        new = first = reacquired = 0
        for id_, is_seen, is_classified in zip(ids.tolist(), seen.tolist(), classified.tolist(), strict=True):
            before = self._alive.get(id_, TrackHistory())
            new += id_ not in self._alive
            first += is_classified and not before.classified
            reacquired += is_classified and before.classified and not before.seen
            alive[id_] = TrackHistory(before.classified or is_classified, is_seen, before.life + is_seen)
        self.lives += [track.life for id_, track in self._alive.items() if id_ not in alive]
        self._alive = alive
        return new, first, reacquired


def interleave(stream: Iterable[Frame], runs: Sequence[ModeRun], turn: int) -> None:
    """Process every frame by every run, `turn` frames at a time, with the first run rotating.

    Args:
        stream: frames, read once.
        runs: of the modes.
        turn: consecutive frames of one run.
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
        first = (first + 1) % len(runs)
    for run in runs:
        run.finish()


def total(counts: Int) -> Counts:
    """Sums over the frames of (frames, 8) counts."""
    return Counts(len(counts), **dict(zip(COUNTS, counts.sum(axis=0).tolist(), strict=True)))
