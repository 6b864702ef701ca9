"""One fusion over recorded drives: what it says of every proposal, and what it asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.classification.prior import Prior
from modt.classification.scheduler import LinearCost, Scheduler
from modt.config import SchedulerConfig
from modt.energy.ledger import NullLedger
from modt.pipeline import Fusion, Pipeline
from modt.types import Bool, Float64, Frame, Int, Proposals, Tracks
from tools.study.recording import Player, Recording
from tools.train.scores import average_precision

FIRST, FIRST_KEY, FURTHER, DOUBT = CALLS = ("first views", "first key views", "further views", "doubts")


class Counting:
    """A fusion whose calls are counted by their reason; for the rest the fusion itself.

    Args:
        fusion: the one that decides.

    Attributes:
        calls: made for each reason.
    """

    def __init__(self, fusion: Fusion) -> None:
        self.fusion = fusion
        self.calls = dict.fromkeys(CALLS, 0)

    def asks(self, tracks: Tracks, proposals: Proposals, asking: Bool) -> Bool:
        """As the fusion says."""
        return self.fusion.asks(tracks, proposals, asking)

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """As the fusion does."""
        new, unfused = ~tracks.viewed[rows], tracks.views[rows] == 0
        reason = np.select([new, tracks.final[rows], unfused], [0, 3, 1], 2)
        for name, n in zip(CALLS, np.bincount(reason, minlength=len(CALLS)).tolist(), strict=True):
            self.calls[name] += n
        return self.fusion.fuse(tracks, proposals, rows, likelihood)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of some drives.

    Attributes:
        precision: average precision of each class that the drives show.
        calls: made for each reason.
        share: of the calls of tracking by detection.
        each: mean average precision of each drive by itself.
    """

    precision: dict[str, float]
    calls: dict[str, int]
    share: float
    each: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Of the average precisions."""
        return _mean(self.precision)


def replay(
    recordings: Sequence[Recording], fusion: Callable[[Prior], Fusion], ask_from: int, judged_from: int | None = None
) -> Outcome:
    """Play drives to a fusion, without a budget.

    Args:
        recordings: the drives.
        fusion: makes one for each drive, which may ask the prior.
        ask_from: frames with a proposal before a track asks for a class.
        judged_from: frames from which proposals are judged, those of ask_from where it is not given: before it no
            setting of the fusion has a say.
    """
    calls = dict.fromkeys(CALLS, 0)
    parts: list[tuple[Float64, Int]] = []
    for recording in recordings:
        player = Player(recording, ask_from)
        counting = Counting(fusion(player))
        parts.append(_played(recording, player, counting, judged_from or ask_from))
        calls = {name: n + counting.calls[name] for name, n in calls.items()}
    probability, kind = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    total = sum(recording.n_proposals for recording in recordings)
    each = tuple(_mean(_precision(*part)) for part in parts)
    return Outcome(_precision(probability, kind), calls, sum(calls.values()) / max(total, 1), each)


def _played(recording: Recording, player: Player, fusion: Fusion, judged_from: int) -> tuple[Float64, Int]:
    """(R, 4) what is said of the judged proposals, and (R,) what they are."""
    config = SchedulerConfig()
    scheduler = Scheduler(config.worth, LinearCost(128, config.cost))
    pipeline = Pipeline(player, player, fusion, scheduler, player, NullLedger())
    nothing = np.zeros((0, 4), np.float32)
    said, true = [np.zeros((0, N_CLASSES))], [np.zeros(0, np.int64)]
    for index, moment in enumerate(recording.moments):
        tracks = pipeline.step(Frame(index, 0.0, nothing)).tracks
        rows = moment.track[moment.judged & (tracks.hits[moment.track] >= judged_from)]
        said.append(tracks.posterior[rows])
        true.append(moment.kind[tracks.proposal[rows]])
    return np.concatenate(said), np.concatenate(true)


def _precision(probability: Float64, kind: Int) -> dict[str, float]:
    truth = np.bincount(kind, minlength=N_CLASSES)
    every = average_precision(probability, kind, truth)
    return {name: every[name] for name, n in zip(CLASS_NAMES, truth, strict=True) if name in every and n}


def _mean(precision: dict[str, float]) -> float:
    return float(np.mean([*precision.values()])) if precision else float("nan")
