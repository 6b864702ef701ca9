"""The modes on the same stream, in turns, so that whatever else the machine does falls on all of them alike."""

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

COUNTS = ("proposals", "foreground", "tracks", "classified_tracks", "classified", "refound", "points", "calls")
"""Columns of a run's counts, as in energy.savings.Counts."""


class Watched:
    """A classifier that remembers which proposals of the frame it was given."""

    def __init__(self, classifier: Classifier) -> None:
        self._classifier = classifier
        self.which: Int = np.zeros(0, np.int64)

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(Y|X) of the proposals named."""
        self.which = which
        return self._classifier.classify(points, proposals, which)

    def facts(self) -> dict[str, str]:
        """The model's file and hash."""
        return self._classifier.facts()


@dataclass(frozen=True, slots=True)
class Followed:
    """A track alive.

    Attributes:
        classified: at least once.
        seen: in the last frame.
        life: frames in which it was seen.
    """

    classified: bool = False
    seen: bool = True
    life: int = 0


@dataclass
class Contender:
    """One mode on its way through the stream.

    Attributes:
        name: of the mode.
        pipeline: its stages; the classifier is the one watched.
        ledger: that the pipeline books on.
        watched: the classifier.
        budget: of the frame with that index.
        windows: reads the meters at the edges, None where another contender may work within a window.
    """

    name: str
    pipeline: Pipeline
    ledger: Ledger
    watched: Watched
    budget: Callable[[int], Budget]
    windows: Windows | None = None
    lines: list[dict[str, Any]] = field(default_factory=list)
    energy_lines: list[dict[str, Any]] = field(default_factory=list)
    lives: list[int] = field(default_factory=list)
    _counts: list[tuple[int, ...]] = field(default_factory=list)
    _alive: dict[int, Followed] = field(default_factory=dict)

    def step(self, frame: Frame) -> None:
        """One frame; what is counted beside the ledger is counted between its frames."""
        self.watched.which = self.watched.which[:0]
        result = self.pipeline.step(frame, self.budget(frame.index))
        line = self.ledger.close_frame(frame.index)
        self.lines.append(line)
        self._count(result, line)
        if self.windows is not None:
            closed = self.windows.add(line)
            if closed is not None:
                self.energy_lines.append(closed)

    def begin_turn(self) -> None:
        """What the others did meanwhile is not this one's time or energy."""
        self.ledger.close_frame(-1)
        if self.windows is not None:
            self.windows.close()

    def end_turn(self) -> None:
        """Read the meters before another one begins."""
        if self.windows is not None:
            self.energy_lines.append(self.windows.close())

    def finish(self) -> None:
        """The stream has ended: tracks still alive have lived as long as they were seen."""
        self.lives += [track.life for track in self._alive.values()]

    def counts(self) -> Int:
        """(frames, 8) what each frame counted, columns as COUNTS."""
        return np.array(self._counts, np.int64).reshape(-1, len(COUNTS))

    def cpu_s(self) -> Float64:
        """(frames, stages) CPU time of each stage of the pipeline [s]."""
        rows = [[line["stages"].get(s, {}).get("cpu_ns", 0) for s in STAGES] for line in self.lines]
        return 1e-9 * np.array(rows, float).reshape(-1, len(STAGES))

    def _count(self, result: FrameResult, line: dict[str, Any]) -> None:
        tracks = result.tracks
        seen = tracks.proposal != NONE
        asked = np.zeros(len(tracks), np.bool_)
        asked[tracks.row_of_proposal(len(result.proposals))[self.watched.which]] = True
        new, first, refound = self._follow(tracks.id, seen, asked)
        foreground = seen & (tracks.object_class != ObjectClass.BACKGROUND)
        row = line["stages"].get(CLASSIFICATION, {})
        self._counts.append(
            (
                len(result.proposals),
                int(foreground.sum()),
                new,
                first,
                result.n_classified,
                refound,
                row.get("points", 0),
                row.get("calls", 0),
            )
        )

    def _follow(self, ids: Int, seen: Bool, asked: Bool) -> tuple[int, int, int]:
        """How many tracks are new, classified for the first time, and classified again after they were lost."""
        alive: dict[int, Followed] = {}
        new = first = refound = 0
        for id_, is_seen, is_asked in zip(ids.tolist(), seen.tolist(), asked.tolist(), strict=True):
            before = self._alive.get(id_, Followed())
            new += id_ not in self._alive
            first += is_asked and not before.classified
            refound += is_asked and before.classified and not before.seen
            alive[id_] = Followed(before.classified or is_asked, is_seen, before.life + is_seen)
        self.lives += [track.life for id_, track in self._alive.items() if id_ not in alive]
        self._alive = alive
        return new, first, refound


def interleave(stream: Iterable[Frame], contenders: Sequence[Contender], turn: int) -> None:
    """Every contender works on every frame, turn frames at a time, and each goes first equally often.

    Args:
        stream: frames, read once.
        contenders: that share them.
        turn: frames that one works on before the next one does.
    """
    gc.collect()
    gc.freeze()
    frames = iter(stream)
    number = 0
    while block := list(islice(frames, turn)):
        for k in range(len(contenders)):
            contender = contenders[(number + k) % len(contenders)]
            contender.begin_turn()
            for frame in block:
                contender.step(frame)
            contender.end_turn()
        number += 1
    for contender in contenders:
        contender.finish()


def total(counts: Int) -> Counts:
    """Sums over the frames of (frames, 8) counts."""
    return Counts(len(counts), **dict(zip(COUNTS, counts.sum(axis=0).tolist(), strict=True)))
