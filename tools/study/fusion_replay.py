"""Replay of a fusion over recorded drives: average precision and number of classifier calls."""

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
from modt_desk.evaluation.class_score import average_precision
from tools.study.recording import Playback, Recording

CALLS = ("first views", "first key views", "further views", "reviews")


class CallCounter:
    """Wrapper of a fusion that counts classifier calls by reason.

    Args:
        fusion: wrapped.

    Attributes:
        calls: number for each reason.
    """

    def __init__(self, fusion: Fusion) -> None:
        self.fusion = fusion
        self.calls = dict.fromkeys(CALLS, 0)

    def asks(self, tracks: Tracks, proposals: Proposals, wants_class: Bool) -> Bool:
        """Delegate."""
        return self.fusion.asks(tracks, proposals, wants_class)

    def fuse(self, tracks: Tracks, proposals: Proposals, rows: Int, likelihood: Float64) -> Bool:
        """Count the calls and delegate."""
        new, unfused = ~tracks.viewed[rows], tracks.views[rows] == 0
        reason = np.select([new, tracks.final[rows], unfused], [0, 3, 1], 2)
        for name, n in zip(CALLS, np.bincount(reason, minlength=len(CALLS)).tolist(), strict=True):
            self.calls[name] += n
        return self.fusion.fuse(tracks, proposals, rows, likelihood)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a replay.

    Attributes:
        precision: average precision of each class present.
        calls: number for each reason.
        share: calls relative to tracking by detection.
        each: mean average precision of each drive.
    """

    precision: dict[str, float]
    calls: dict[str, int]
    share: float
    each: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Mean average precision."""
        return _mean(self.precision)


def replay(
    recordings: Sequence[Recording],
    fusion: Callable[[Prior], Fusion],
    min_hits: int = 1,
    scored_from: int | None = None,
) -> Outcome:
    """Replay drives with a fusion, without a budget.

    Args:
        recordings: the drives.
        fusion: makes the fusion of a drive from its prior.
        min_hits: minimum number of frames with a proposal before a track is classified.
        scored_from: minimum number of such frames before a proposal is scored, by default `min_hits`: earlier ones
            do not depend on the fusion.
    """
    calls = dict.fromkeys(CALLS, 0)
    parts: list[tuple[Float64, Int]] = []
    for recording in recordings:
        playback = Playback(recording, min_hits)
        counter = CallCounter(fusion(playback))
        parts.append(_played(recording, playback, counter, scored_from or min_hits))
        calls = {name: n + counter.calls[name] for name, n in calls.items()}
    probability, kind = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    total = sum(recording.n_proposals for recording in recordings)
    each = tuple(_mean(_precision(*part)) for part in parts)
    return Outcome(_precision(probability, kind), calls, sum(calls.values()) / max(total, 1), each)


def _played(recording: Recording, playback: Playback, fusion: Fusion, scored_from: int) -> tuple[Float64, Int]:
    """(R, 4) posteriors of the scored proposals, and (R,) their true classes."""
    config = SchedulerConfig()
    scheduler = Scheduler(config.worth, LinearCost(128, lambda points: int(points.sum()), config.cost))
    pipeline = Pipeline(playback, playback, playback, fusion, scheduler, playback, playback, NullLedger())
    no_points = np.zeros((0, 4), np.float32)
    posterior, true = [np.zeros((0, N_CLASSES))], [np.zeros(0, np.int64)]
    for index, recorded in enumerate(recording.frames):
        tracks = pipeline.step(Frame(index, 0.0, no_points)).tracks
        rows = recorded.track[recorded.scored & (tracks.hits[recorded.track] >= scored_from)]
        posterior.append(tracks.posterior[rows])
        true.append(recorded.kind[tracks.proposal[rows]])
    return np.concatenate(posterior), np.concatenate(true)


def _precision(probability: Float64, kind: Int) -> dict[str, float]:
    truth = np.bincount(kind, minlength=N_CLASSES)
    every = average_precision(probability, kind, truth)
    return {name: every[name] for name, n in zip(CLASS_NAMES, truth, strict=True) if name in every and n}


def _mean(precision: dict[str, float]) -> float:
    return float(np.mean([*precision.values()])) if precision else float("nan")
