"""Gamma predicted and measured, from what the modes counted and cost on the same frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modt.energy.savings import Beside, Prediction, UnitCosts, predict
from modt.pipeline import CLASSIFICATION, FUSION, SCHEDULING, SEGMENTATION, STAGES, TRACKING
from modt.reporting.comparison import COUNTS, total
from modt.types import Float64, Int

BLOCK = 8
"""Frames that are resampled together, for neighbours resemble each other."""
RESAMPLES = 400
CALLS, CLASSIFIED, POINTS = (COUNTS.index(name) for name in ("calls", "classified", "points"))
SEG, TRACK, CLASS, SCHEDULE, FUSE = (
    STAGES.index(s) for s in (SEGMENTATION, TRACKING, CLASSIFICATION, SCHEDULING, FUSION)
)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What one mode did and cost on F frames.

    Attributes:
        counts: (F, 8) columns as COUNTS.
        cost: (F, S) of the pipeline's stages, in joules or CPU seconds; the median over repetitions.
    """

    counts: Int
    cost: Float64

    def take(self, frames: Int) -> Evidence:
        """The frames given."""
        return Evidence(self.counts[frames], self.cost[frames])


@dataclass(frozen=True, slots=True)
class Saving:
    """Gamma of one mode over tracking-by-detection, with intervals at 95 %.

    Attributes:
        prediction: from counts and unit costs.
        measured: ratio of what the two runs cost.
        predicted_interval, measured_interval: over resampled frames.
        deviation_interval: of predicted over measured, less one.
    """

    prediction: Prediction
    measured: float
    predicted_interval: tuple[float, float]
    measured_interval: tuple[float, float]
    deviation_interval: tuple[float, float]

    @property
    def predicted(self) -> float:
        """By the full formula."""
        return self.prediction.model.gamma

    @property
    def deviation(self) -> float:
        """Predicted over measured, less one."""
        return self.predicted / self.measured - 1.0


def unit_costs(varied: Evidence) -> UnitCosts:
    """Costs of units of work, from a run whose classification load was varied from frame to frame."""
    cost = varied.cost
    X = varied.counts[:, [CALLS, CLASSIFIED, POINTS]].astype(float)
    busy = X[:, 0] > 0
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-12)
    solved = np.linalg.lstsq(X[busy] / scale, cost[busy, CLASS], rcond=None)[0] / scale if busy.any() else np.zeros(3)
    call, item, point = solved.tolist()
    return UnitCosts(
        seg=float(cost[:, SEG].mean()),
        track=float(cost[:, TRACK].mean()),
        class_call=call,
        class_item=item,
        class_point=point,
    )


def saving(baseline: Evidence, run: Evidence, varied: Evidence, random: np.random.Generator) -> Saving:
    """Predicts with the costs of the varied run, which is neither of the two, and compares.

    Args:
        baseline: tracking-by-detection, F frames.
        run: the proposed pipeline on the same F frames.
        varied: the same frames once or several times over, under varied load.
        random: draws the frames of the intervals.
    """
    n = len(baseline.counts)
    passes = len(varied.counts) // n

    def both(frames: Int) -> tuple[Prediction, float]:
        a, b = baseline.take(frames), run.take(frames)
        costs = unit_costs(varied.take((frames + n * np.arange(passes)[:, None]).ravel()))
        prediction = predict(total(a.counts), total(b.counts), costs, beside_of(a), beside_of(b))
        return prediction, float(a.cost.sum() / b.cost.sum())

    prediction, measured = both(np.arange(n))
    drawn = [both(_blocks(n, random)) for _ in range(RESAMPLES)]
    predicted_all = np.array([p.model.gamma for p, _ in drawn])
    measured_all = np.array([m for _, m in drawn])
    return Saving(
        prediction,
        measured,
        _interval(predicted_all),
        _interval(measured_all),
        _interval(predicted_all / measured_all - 1.0),
    )


def mean_interval(values: Float64, random: np.random.Generator) -> tuple[float, float]:
    """95 % interval of the mean of (F,) values over resampled frames."""
    return interval(len(values), lambda frames: float(values[frames].mean()), random)


def interval(n: int, of: Callable[[Int], float], random: np.random.Generator) -> tuple[float, float]:
    """95 % interval of anything computed over n resampled frames."""
    return _interval(np.array([of(_blocks(n, random)) for _ in range(RESAMPLES)]))


def beside_of(run: Evidence) -> Beside:
    """What a run paid for what Equation 2 does not know, a frame."""
    mean = run.cost.mean(axis=0)
    return Beside(track=float(mean[TRACK]), choose=float(mean[[SCHEDULE, FUSE]].sum()))


def _blocks(n: int, random: np.random.Generator) -> Int:
    """(n,) frames drawn in blocks, round the end of the stream."""
    starts = random.integers(0, n, size=-(-n // BLOCK))
    frames: Int = ((starts[:, None] + np.arange(BLOCK)) % n).ravel()[:n]
    return frames


def _interval(values: Float64) -> tuple[float, float]:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
