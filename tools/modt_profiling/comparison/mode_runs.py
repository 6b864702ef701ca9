"""Assembly of the runs of a comparison, by the same parts as a replay."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from modt.app import assembly, inputs
from modt.classification.call_cost import padded_size
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger
from modt.energy.meters.meter import Conditions, Meter
from modt.energy.windows import Clocks, Windows
from modt.sources.stream import StreamInfo
from modt.types import UNLIMITED, Budget, Frame, Int
from modt_profiling.comparison.comparison import ModeRun, RecordingFusion, Repetition, interleave
from modt_profiling.comparison.prediction import OBSERVED

BASELINE = "conventional"
MODES = (BASELINE, "efficient", "accurate")
VARIED = "varied"
"""Tracking-by-detection with a random classification load, whose costs give the unit costs of the reconciliation."""
_LOADS = (0, 1, 2, 4, 8, 16, 32, 64, 128, None, None)
"""Calls of a frame, None for all. Unit costs fitted to few calls alone would not hold for many."""


@dataclass(frozen=True)
class Comparison:
    """Parameters of a comparison."""

    request: inputs.Request
    profile: ProfileConfig
    core: int | None
    meters: tuple[Meter, ...]  # to read; none where energy follows from CPU time

    @property
    def turn_frames(self) -> int:
        """Consecutive frames of one mode.

        A meter needs a second or more of one mode; CPU time is compared frame by frame, which spreads other load of
        the machine evenly.
        """
        return 10**9 if self.meters else 1

    def repetition(self, end_turn: Callable[[], None]) -> Repetition:
        """Every mode once through the stream, from its initial state; all repetitions do the same work."""
        runs = {name: self._mode_run(name) for name in (*MODES, VARIED)}
        stream = inputs.stream(self.request)
        for frame in islice(stream, 1):
            for mode_run in runs.values():
                _warm_up(mode_run, frame)
        interleave(stream, [*runs.values()], self.turn_frames, end_turn)
        return runs

    def turns(self, frames: int) -> int:
        """Number of turns in a repetition of so many frames."""
        return math.ceil(frames / self.turn_frames) * (len(MODES) + 1)

    def _mode_run(self, name: str) -> ModeRun:
        mode = assembly.MODES[BASELINE if name == VARIED else name]
        ledger = Ledger()
        fov = inputs.field_of_view(self.request, inputs.stream(self.request).info)
        pipeline = assembly.pipeline(mode, self.profile, fov, ledger)
        budget = mode.budget(self.profile)
        return ModeRun(
            pipeline=pipeline,
            ledger=ledger,
            budget=varied_load if name == VARIED else lambda _frame: budget,
            windows=Windows(self.meters, Clocks(), Conditions(self.core or 0)) if self.meters else None,
        )


def identity(request: inputs.Request, info: StreamInfo) -> dict[str, str | None]:
    """Name and place of a stream: names of drives repeat."""
    path = None if request.path is None else str(request.path.resolve())
    return {"stream": info.name, "path": path}


def observe(request: inputs.Request, profile: ProfileConfig, frames: int | None) -> Int:
    """(F, 7) of the first so many frames, tracked without a classification.

    Columns as prediction.OBSERVED, then of each mode but the baseline the tracks that ask for a class for the first
    time.
    """
    columns = [_tracked(request, profile, frames, mode) for mode in MODES]
    return np.concatenate([columns[0][:, :-1], *(found[:, -1:] for found in columns[1:])], axis=1)


def _tracked(request: inputs.Request, profile: ProfileConfig, frames: int | None, mode: str) -> Int:
    """(F, 6) prediction.OBSERVED, and the tracks that ask for the first time."""
    fov = inputs.field_of_view(request, inputs.stream(request).info)
    pipeline = assembly.pipeline(assembly.MODES[mode], profile, fov)
    fusion = RecordingFusion(pipeline.fusion)
    pipeline = replace(pipeline, fusion=fusion)
    size = padded_size(profile.classification)
    rows = []
    alive: set[int] = set()
    for frame in islice(inputs.stream(request), frames):
        result = pipeline.step(frame, Budget(calls=0))
        before = alive
        alive = set(result.tracks.id.tolist())
        count = result.proposals.count
        started = len(alive - before)
        asked = fusion.first_asked(alive)
        rows.append((len(frame.points), len(count), len(alive), started, size(count), asked))
    return np.array(rows, np.int64).reshape(-1, len(OBSERVED) + 1)


def _warm_up(mode_run: ModeRun, frame: Frame) -> None:
    """Run the two stages without a state once: first calls allocate and load."""
    parts = mode_run.pipeline
    proposals = parts.view.segment(frame)
    parts.classifier.classify(frame.points, proposals, np.arange(len(proposals)))


def varied_load(frame: int) -> Budget:
    """A random budget for each frame, the same in every repetition."""
    load = _LOADS[np.random.default_rng(frame).integers(len(_LOADS))]
    return UNLIMITED if load is None else Budget(calls=load)
