"""Puts the contenders of a comparison together, by the same assembling as a replay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np

from modt import assembly
from modt.cli import assemble, metering
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger
from modt.reporting.comparison import Contender, Watched, interleave
from modt.reporting.repetitions import Trial
from modt.types import Budget, Frame

BASELINE = "conventional"
MODES = (BASELINE, "efficient", "accurate")
VARIED = "varied"
"""Tracking-by-detection whose classification load is varied on purpose: what its work costs prices the others'."""
LOADS = (0, 1, 2, 3, 5, 8, 12, 16, 20, 30, 45, 60)


@dataclass(frozen=True, slots=True)
class Contest:
    """What is compared, and how.

    Attributes:
        request: stream, field of view, frames.
        profile: of sensor and board.
        repeat: times over.
        core: that the process is confined to.
        meter: name of the meter to read, None for the best.
        turn: frames that one mode works on before the next; None: the meter decides.
    """

    request: assemble.Request
    profile: ProfileConfig
    repeat: int
    core: int | None
    meter: str | None = None
    turn: int | None = None

    def turns(self) -> tuple[int, bool]:
        """Frames a turn, and whether meters are read.

        A meter needs a second or more of one mode's work; CPU time can be compared frame by frame, which spreads
        whatever else the machine does evenly.
        """
        estimated = metering.is_estimated(self.profile.energy, self.meter)
        turn = self.turn or (1 if estimated else 10**9)
        return turn, not estimated

    def trial(self, number: int) -> Trial:
        """Every mode once through the stream, all starting afresh."""
        stream = assemble.stream(self.request)
        turn, metered = self.turns()
        contenders = [self._contender(name, number, metered) for name in (*MODES, VARIED)]
        frames = iter(stream)
        first = list(islice(frames, 1))
        for frame in first:
            for contender in contenders:
                _warm_up(contender, frame)
        interleave(chain(first, frames), contenders, turn)
        return Trial(contenders)

    def _contender(self, name: str, number: int, metered: bool) -> Contender:
        mode = assembly.MODES[BASELINE if name == VARIED else name]
        ledger = Ledger()
        fov = assemble.field_of_view(self.request, assemble.stream(self.request))
        whole = assembly.pipeline(mode, self.profile, fov, ledger)
        watched = Watched(whole.classifier)
        return Contender(
            name=name,
            pipeline=replace(whole, classifier=watched),
            ledger=ledger,
            watched=watched,
            budget=varied_load(number) if name == VARIED else _constant(mode.budget(self.profile)),
            windows=metering.windows(self.profile.energy, self.core, self.meter) if metered else None,
        )


def _warm_up(contender: Contender, frame: Frame) -> None:
    """First calls allocate and load; they are not what a frame costs. Neither part remembers anything of them."""
    parts = contender.pipeline
    proposals = parts.segmenter.segment(frame.points)
    parts.classifier.classify(frame.points, proposals, np.arange(len(proposals)))


def varied_load(seed: int) -> Callable[[int], Budget]:
    """A budget that changes at random from frame to frame, the same for the same seed."""

    def budget(frame: int) -> Budget:
        return Budget(calls=int(np.random.default_rng([seed, frame]).choice(LOADS)))

    return budget


def _constant(budget: Budget) -> Callable[[int], Budget]:
    return lambda _frame: budget
