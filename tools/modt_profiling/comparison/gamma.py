"""Gamma measured, and reconciled from the counts and costs of the modes on the same frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from modt.energy.meters.meter import Kind
from modt.types import Float64, Int, Self
from modt_profiling.comparison.comparison import COUNTS, ModeRun, total
from modt_profiling.energy.board_fit import nonnegative_fit
from modt_profiling.energy.savings import OtherCosts, Reconciliation, UnitCosts, reconcile
from modt_profiling.reporting.energy_plots import CLASS, SCHEDULE, SEG, TRACK
from modt_profiling.reporting.quantity import Quantity, estimate, quantity

_BLOCK = 8
"""Frames resampled together, since neighbouring frames are correlated."""
_RESAMPLES = 400
_LOAD = [COUNTS.index(name) for name in ("calls", "classified", "points")]

Interval = tuple[float, float]


@dataclass(frozen=True)
class RunCosts:
    """Counts and costs of one mode on F frames."""

    counts: Int  # (F, C), columns as COUNTS
    cost: Float64  # (F, S) of the pipeline's S stages [CPU s]

    @classmethod
    def median(cls, runs: Sequence[ModeRun]) -> Self:
        """Counts and costs of the repetition of median cost, chosen frame by frame.

        Under a budget of CPU time the work of a frame may differ between repetitions.
        """
        counts = np.stack([run.counts() for run in runs])
        cost = np.stack([run.cpu_s() for run in runs])
        # (repetitions, F, ...): of each frame, the repetition whose cost over all stages is the median
        middle = np.argsort(cost.sum(axis=2), axis=0, kind="stable")[(len(runs) - 1) // 2]
        frames = np.arange(len(middle))
        return cls(counts[middle, frames], cost[middle, frames])

    def take(self, frames: Int) -> RunCosts:
        """Costs of the given frames."""
        return RunCosts(self.counts[frames], self.cost[frames])


@dataclass(frozen=True)
class GammaEstimate:
    """Gamma of one mode over tracking-by-detection, with intervals at 95 % over frames resampled in blocks."""

    reconciliation: Reconciliation
    reconciled: Quantity  # gamma by the full model
    measured: Quantity  # ratio of the costs of the two runs
    deviation: Quantity  # reconciled / measured - 1


def unit_costs(load_varied_run: RunCosts) -> UnitCosts:
    """Costs of units of work, from a run whose classification load varied from frame to frame."""
    cost = load_varied_run.cost
    load = load_varied_run.counts[:, _LOAD].astype(float)
    solved = nonnegative_fit(load.T @ load, load.T @ cost[:, CLASS])
    return UnitCosts(float(cost[:, SEG].mean()), float(cost[:, TRACK].sum(axis=1).mean()), *solved.tolist())


def estimate_gamma(
    baseline: RunCosts, run: RunCosts, load_varied_run: RunCosts, random: np.random.Generator
) -> GammaEstimate:
    """Reconciled and measured gamma of a run on the F frames of tracking-by-detection.

    The unit costs come from a third run over the same frames, whose load was varied.
    """
    n = len(baseline.counts)

    def reconciled_and_measured(frames: Int) -> tuple[Reconciliation, float]:
        a = baseline.take(frames)
        b = run.take(frames)
        costs = unit_costs(load_varied_run.take(frames))
        reconciled = reconcile(total(a.counts), total(b.counts), costs, other_costs(a), other_costs(b))
        return reconciled, float(a.cost.sum() / b.cost.sum())

    reconciliation, ratio = reconciled_and_measured(np.arange(n))
    gamma = reconciliation.model.gamma
    resampled = [reconciled_and_measured(blocks(n, random)) for _ in range(_RESAMPLES)]
    gammas = np.array([found.model.gamma for found, _ in resampled])
    ratios = np.array([found for _, found in resampled])
    return GammaEstimate(
        reconciliation,
        reconciled=estimate(gamma, "", _interval(gammas)),
        measured=quantity(ratio, "", Kind.MEASURED, _interval(ratios)),
        deviation=estimate(gamma / ratio - 1.0, "", _interval(gammas / ratios - 1.0)),
    )


def interval(n: int, statistic: Callable[[Int], float], random: np.random.Generator) -> Interval:
    """95 % interval of a statistic over n resampled frames."""
    return _interval(np.array([statistic(blocks(n, random)) for _ in range(_RESAMPLES)]))


def mean(values: Float64, unit: str, kind: Kind, random: np.random.Generator) -> Quantity:
    """Mean of (F,) values, with its interval over resampled frames."""
    bounds = interval(len(values), lambda frames: float(values[frames].mean()), random)
    return quantity(float(values.mean()), unit, kind, bounds)


def other_costs(run: RunCosts) -> OtherCosts:
    """Mean costs a frame of the stages that Equation 2 leaves out."""
    cost = run.cost.mean(axis=0)
    return OtherCosts(float(cost[TRACK].sum()), float(cost[SCHEDULE].sum()))


def blocks(n: int, random: np.random.Generator) -> Int:
    """(n,) frames drawn in circular blocks."""
    starts = random.integers(0, n, size=-(-n // _BLOCK))
    return np.asarray(((starts[:, None] + np.arange(_BLOCK)) % n).ravel()[:n])


def _interval(values: Float64) -> Interval:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
