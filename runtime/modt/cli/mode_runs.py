"""Assembly of the runs of a comparison, by the same parts as a replay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from modt import assembly
from modt.cli import assemble, metering
from modt.config import ProfileConfig
from modt.energy.instrumentation import padded_size
from modt.energy.ledger import Ledger, NullLedger
from modt.energy.meters.meter import Meter
from modt.reporting.comparison import ModeRun, RecordingClassifier, Repetition, interleave
from modt.reporting.prediction import OBSERVED
from modt.types import Budget, Frame, Int

BASELINE = "conventional"
MODES = (BASELINE, "efficient", "accurate")
VARIED = "varied"
"""Tracking-by-detection with a random classification load: its costs are the unit costs of the reconciliation."""
_LOADS = (0, 1, 2, 3, 5, 8, 12, 16, 20, 30, 45, 60)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Parameters of a comparison."""

    request: assemble.Request
    profile: ProfileConfig
    core: int | None
    meters: tuple[Meter, ...]  # to read; none where energy follows from CPU time
    turn: int | None  # consecutive frames of one mode, None for the default

    @property
    def turn_frames(self) -> int:
        """Consecutive frames of one mode.

        A meter needs a second or more of one mode; CPU time is compared frame by frame, which spreads other load of
        the machine evenly.
        """
        return self.turn or (10**9 if self.meters else 1)

    def repetition(self, seed: int) -> Repetition:
        """Every mode once through the stream, from its initial state."""
        runs = {name: self._mode_run(name, seed) for name in (*MODES, VARIED)}
        stream = assemble.stream(self.request)
        for frame in islice(stream, 1):
            for mode_run in runs.values():
                _warm_up(mode_run, frame)
        interleave(stream, [*runs.values()], self.turn_frames)
        return runs

    def _mode_run(self, name: str, seed: int) -> ModeRun:
        mode = assembly.MODES[BASELINE if name == VARIED else name]
        ledger = Ledger()
        fov = assemble.field_of_view(self.request, assemble.stream(self.request))
        pipeline = assembly.pipeline(mode, self.profile, fov, ledger)
        recorder = RecordingClassifier(pipeline.classifier)
        budget, window = mode.budget(self.profile), self.profile.energy.windows
        return ModeRun(
            pipeline=replace(pipeline, classifier=recorder),
            ledger=ledger,
            recorder=recorder,
            budget=varied_load(seed) if name == VARIED else lambda _frame: budget,
            windows=metering.windows(self.meters, self.core, window) if self.meters else None,
        )


def observe(request: assemble.Request, profile: ProfileConfig, frames: int | None) -> Int:
    """(F, 5) prediction.OBSERVED of the first so many frames, tracked without a classification."""
    fov = assemble.field_of_view(request, assemble.stream(request))
    pipeline = assembly.pipeline(assembly.MODES[BASELINE], profile, fov, NullLedger())
    size, rows = padded_size(profile.classification), []
    alive: set[int] = set()
    for frame in islice(assemble.stream(request), frames):
        result = pipeline.step(frame, Budget(calls=0))
        before, alive = alive, set(result.tracks.id.tolist())
        count = result.proposals.count
        rows.append((len(frame.points), len(count), len(alive), len(alive - before), size(count)))
    return np.array(rows, np.int64).reshape(-1, len(OBSERVED))


def _warm_up(mode_run: ModeRun, frame: Frame) -> None:
    """Run the two stages without a state once: first calls allocate and load."""
    parts = mode_run.pipeline
    proposals = parts.segmenter.segment(frame.points)
    parts.classifier.classify(frame.points, proposals, np.arange(len(proposals)))


def varied_load(seed: int) -> Callable[[int], Budget]:
    """A random budget for each frame, reproducible by the seed."""

    def budget(frame: int) -> Budget:
        return Budget(calls=int(np.random.default_rng([seed, frame]).choice(_LOADS)))

    return budget
