"""Energy of the modes on a stream before any of them has run on it.

The costs of units of work, and the number of classifications of a track, come from other streams. The stream itself
contributes the counts of tracking without classification. Unlike the reconciliation
(modt_profiling.energy.savings) the prediction can be wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from modt.types import Float64, Int, Self
from modt_profiling.comparison.comparison import COUNTS
from modt_profiling.comparison.gamma import RunCosts, blocks
from modt_profiling.energy.board_fit import nonnegative_fit
from modt_profiling.energy.savings import EnergyModel
from modt_profiling.reporting.energy_plots import CLASS, SCHEDULE, SEG, TRACK

Runs = dict[str, RunCosts]
"""A stream's runs: tracking-by-detection first, the run of varied load last, the modes between."""
OBSERVED = ("sweep_points", "proposals", "alive", "tracks", "points")
"""First columns of what tracking without classification shows of a frame: `tracks` counts the new ones, `points` what
the network would process if it classified every proposal. A further column for each mode between counts the tracks
that ask for a class for the first time."""
_RESAMPLES = 300
_VARIED = 0.2
"""Relative spread of the points of sweeps above which segmentation has a constant beside its cost a point."""
_PARTS = 4
"""Parts of the only stream of a calibration that are left out in turn."""
_START = 8
"""Frames at the start of a stream in which all that is there is new."""


@dataclass(frozen=True)
class Stream:
    """A stream on which the modes did run."""

    runs: Runs
    observed: Int  # (F, 7) OBSERVED

    def take(self, frames: Int) -> Stream:
        """The given frames."""
        return Stream({name: run.take(frames) for name, run in self.runs.items()}, self.observed[frames])


@dataclass(frozen=True)
class Views:
    """Selection of the proposals that a mode classifies."""

    each: float  # classifications of a track that asks
    size: float  # network's points of such a proposal over those of any that is seen
    calls: float  # rate of calls over the rate of classifications; below 1 where these come together

    @classmethod
    def of(cls, run: RunCosts, asking: Float64, size: float) -> Self:
        """Selection seen in a run.

        Args:
            run: run of the mode.
            asking: (F,) number of tracks that ask.
            size: points of the network for a proposal that is seen.
        """
        each = _column(run, "classified").mean()
        if not each:
            return cls(0.0, 1.0, 1.0)
        # Classifications come as by a Poisson process in calls: a share p of the frames with a call is a rate of
        # -log(1 - p). Where every frame has one, p is taken as half a frame less than one.
        frames_with_calls = min(_column(run, "calls").mean(), 1.0 - 0.5 / len(run.counts))
        relative = _column(run, "points").sum() / _column(run, "classified").sum() / max(size, 1e-9)
        return cls(each / max(float(asking.mean()), 1e-9), relative, -np.log1p(-frames_with_calls) / each)


@dataclass(frozen=True)
class Rates:
    """Cost of each unit of work [CPU s], and the selection of each mode.

    Tracking, scheduling and fusion are fitted to the counts of tracking without classification: known classes regroup
    proposals, so that the counts of a mode itself are not known before it runs.
    """

    segmentation: Float64  # (2,) a frame, a point of the sweep
    classification: Float64  # (3,) a call, a proposal, a point of the network
    tracking: dict[str, Float64]  # by mode: (3,) costs of a frame, a proposal, a track
    scheduling: dict[str, Float64]  # by mode, with fusion: (2,) costs of a frame, a track
    views: dict[str, Views]  # by mode; in tracking-by-detection every proposal asks

    @classmethod
    def fit(cls, streams: Sequence[Stream]) -> Self:
        """Fit the rates to all frames of the calibration's streams."""
        runs = {name: _joined([stream.runs[name] for stream in streams]) for name in streams[0].runs}
        observed = np.concatenate([stream.observed for stream in streams]).astype(float)
        *modes, _ = runs
        _, n, alive, _, all_points = observed.T[: len(OBSERVED)]
        # In tracking-by-detection every proposal asks, in the other modes the tracks of their own column.
        asking = [n, *observed.T[len(OBSERVED) :]]
        size = float(all_points.sum() / max(n.sum(), 1.0))
        every_frame = np.ones(len(n))
        every = _joined([*runs.values()])
        points = _column(every, "sweep_points")
        segmentation = np.array([0.0, every.cost[:, SEG].sum() / max(points.sum(), 1.0)])
        if points.std() > _VARIED * points.mean():
            segmentation = _fit((np.ones(len(points)), points), every.cost[:, [SEG]])
        load = [_column(every, name) for name in ("calls", "classified", "points")]
        return cls(
            segmentation=segmentation,
            classification=_fit(load, every.cost[:, [CLASS]]),
            tracking={mode: _fit((every_frame, n, alive), runs[mode].cost[:, TRACK]) for mode in modes},
            scheduling={mode: _fit((every_frame, alive), runs[mode].cost[:, SCHEDULE]) for mode in modes},
            views={mode: Views.of(runs[mode], asks, size) for mode, asks in zip(modes, asking, strict=True)},
        )


@dataclass(frozen=True)
class Expected:
    """Expectation for one stream."""

    cost: dict[str, float]  # cost of a frame by mode [CPU s]; tracking-by-detection first
    equation: EnergyModel  # Equation 3 bare, with N_go

    @property
    def values(self) -> Float64:
        """(2 M - 1,) the costs of the M modes, then gamma of each but the first."""
        return _with_gamma([*self.cost.values()])


def expect(rates: Rates, observed: Int, frames: int) -> Expected:
    """Costs of a stream of so many frames, of which (F, 7) OBSERVED were seen, the first among them."""
    sweep_points, n, alive, _, all_points, *_ = observed.mean(axis=0).tolist()
    tracks, *asked = _means(observed[:, [OBSERVED.index("tracks"), *range(len(OBSERVED), observed.shape[1])]], frames)
    e_seg = float(rates.segmentation @ [1.0, sweep_points])
    asking = dict(zip(rates.views, [n, *asked], strict=True))
    # No mode classifies more than tracking-by-detection, which is the first.
    most = n * next(iter(rates.views.values())).each
    cost = {}
    loads = {}
    for mode, views in rates.views.items():
        items = min(views.each * asking[mode], most)
        points = items * views.size * all_points / max(n, 1e-9)
        loads[mode] = [1.0 - np.exp(-views.calls * items), items, points]
        cost[mode] = float(
            e_seg
            + rates.tracking[mode] @ [1.0, n, alive]
            + rates.scheduling[mode] @ [1.0, alive]
            + rates.classification @ loads[mode]
        )
    # E(class) of Equation 3 is the mean cost of a proposal in tracking-by-detection, shares of calls included.
    base = next(iter(loads.values()))
    e_class = float(rates.classification @ base) / max(base[1], 1e-9)
    return Expected(cost, EnergyModel(e_seg, e_class, n, n / tracks if tracks else 1.0))


@dataclass(frozen=True)
class Forecast:
    """A prediction with its interval at 95 %; arrays as Expected.values."""

    expected: Expected
    low: Float64
    high: Float64
    copied: Float64  # values measured on the calibration's streams, their geometric mean


def _means(started: Int, frames: int) -> list[float]:
    """(k,) means over a stream of so many frames, from counts (F, k) of its first ones.

    The first _START frames count once, because there everything is new.
    """
    start = min(_START, len(started) // 2)
    later = started[start:].mean(axis=0) if len(started) else np.zeros(started.shape[1])
    found: list[float] = ((started[:start].sum(axis=0) + (frames - start) * later) / frames).tolist()
    return found


def forecast(streams: Sequence[Stream], observed: Int, frames: int, random: np.random.Generator) -> Forecast:
    """Prediction for a stream of so many frames from (F, 7) OBSERVED of its first ones.

    The interval is over resampled frames of the calibration and of those seen, and over how far the calibration is
    off on one of its streams when fitted to the others (on a quarter of its only stream, when fitted to the rest).
    """
    expected = expect(Rates.fit(streams), observed, frames)
    errors = np.array([*_errors(streams)])
    spread = np.sqrt((errors**2).mean(axis=0)) * np.sqrt(1.0 + 1.0 / len(errors))
    draws = np.array([np.log(_resampled(streams, observed, frames, random)) for _ in range(_RESAMPLES)])
    margin = np.hypot(spread, draws.std(axis=0)) * stats.t.ppf(0.975, len(errors))
    copied = np.exp(np.mean([np.log(measured(stream)) for stream in streams], axis=0))
    return Forecast(expected, expected.values * np.exp(-margin), expected.values * np.exp(margin), copied)


def measured(stream: Stream) -> Float64:
    """Values as in Expected, measured on the runs of a stream."""
    *modes, _ = stream.runs.values()
    return _with_gamma([float(run.cost.sum(axis=1).mean()) for run in modes])


def _errors(streams: Sequence[Stream]) -> Iterator[Float64]:
    """Logarithmic errors of the values of each stream, predicted from the others."""
    if len(streams) == 1:
        quarters = np.array_split(np.arange(len(streams[0].observed)), _PARTS)
        streams = [streams[0].take(part) for part in quarters]
    for k, left_out in enumerate(streams):
        rates = Rates.fit([*streams[:k], *streams[k + 1 :]])
        seen = left_out.observed
        yield np.log(expect(rates, seen, len(seen)).values / measured(left_out))


def _resampled(streams: Sequence[Stream], observed: Int, frames: int, random: np.random.Generator) -> Float64:
    drawn = [stream.take(blocks(len(stream.observed), random)) for stream in streams]
    start = min(_START, len(observed) // 2)
    seen = np.concatenate([observed[:start], observed[start:][blocks(len(observed) - start, random)]])
    return expect(Rates.fit(drawn), seen, frames).values


def _with_gamma(cost: Sequence[float]) -> Float64:
    return np.array([*cost, *(cost[0] / each for each in cost[1:])])


def _joined(runs: Sequence[RunCosts]) -> RunCosts:
    return RunCosts(np.concatenate([run.counts for run in runs]), np.concatenate([run.cost for run in runs]))


def _column(run: RunCosts, name: str) -> Float64:
    return run.counts[:, COUNTS.index(name)].astype(float)


def _fit(columns: Sequence[Float64], cost: Float64) -> Float64:
    """(k,) costs of k columns of (F,) counts, of (F, S) stages together.

    Least squares of errors relative to what a first fit expects: noise is a share of the work, and many calls at once
    would else decide what few cost.
    """
    X = np.stack(columns, axis=1)
    y = cost.sum(axis=1)
    expected = X @ nonnegative_fit(X.T @ X, X.T @ y)
    some = expected > 0
    X = X[some] / expected[some, None]
    y = y[some] / expected[some]
    return nonnegative_fit(X.T @ X, X.T @ y)
