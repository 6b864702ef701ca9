"""Least squares with coefficients of at least 0: no work gives energy back.

The coefficients of a board follow from windows of varied load, with bootstrap intervals.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize, stats

from modt.energy.attribution import CLASSIFICATION, SEGMENTATION, usable
from modt.energy.windows import EnergyWindow
from modt.types import Float64

_RIDGE = 1e-12
"""Added to the scaled normal equations, so that columns which vary together share their cost."""


def nonnegative_fit(gram: Float64, moment: Float64) -> Float64:
    """(p,) coefficients of at least 0, by (p, p) X^T X and (p,) X^T y of counts X; 0 of what was never counted."""
    value = np.zeros(len(moment))
    counted = np.diag(gram) > 0
    if counted.any():
        scale = np.sqrt(np.diag(gram)[counted])
        normal = gram[np.ix_(counted, counted)] / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
        # With X^T X = L L^T, |X b - y| is least where |L^T b - L^-1 X^T y| is: NNLS on p rows in place of n.
        lower = np.linalg.cholesky(normal)
        target = linalg.solve_triangular(lower, moment[counted] / scale, lower=True)
        value[counted] = optimize.nnls(lower.T, target)[0] / scale
    return value


_MAX_CONDITION = 1e6
"""Condition number of the scaled regressors above which they are collinear."""
_RESAMPLES = 1000
"""Resamples of the windows for an interval."""
_TAILS = (0.025, 0.975)
"""Quantiles of the intervals at 95 %."""


@dataclass(frozen=True)
class Regressor:
    """One count of a window: an entry of a stage, or of the whole window where the stage is empty."""

    name: str  # name of its coefficient, with the unit
    stage: str
    key: str
    scale: float = 1.0  # factor on the count, so that the coefficient has its unit

    def count(self, window: EnergyWindow) -> float:
        """Count of one window."""
        row = window.stages.get(self.stage) if self.stage else window
        return self.scale * float(getattr(row, self.key, 0))


IDLE = Regressor("idle_W", "", "wall_ns", 1e-9)
SEG = Regressor("seg_J", SEGMENTATION, "calls")
CLASS = Regressor("class_J", CLASSIFICATION, "items")
POINT = Regressor("point_J", CLASSIFICATION, "points")
REGRESSORS = (IDLE, SEG, CLASS, POINT)


@dataclass(frozen=True)
class Coefficient:
    """A fitted value with its interval at 95 %."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Fit:
    """Result of a fit."""

    coefficients: tuple[Coefficient, ...]  # in the order of the regressors
    windows: int  # used
    dropped: int  # not usable
    residual_J: float  # standard deviation, a window
    explained: float  # share of the variance, at most 1
    condition: float  # number of the scaled regressors

    def __getitem__(self, name: str) -> Coefficient:
        return next(c for c in self.coefficients if c.name == name)


class FitError(Exception):
    """The windows do not determine the coefficients; the message names the load to vary."""


def usable_windows(lines: Iterable[EnergyWindow]) -> list[EnergyWindow]:
    """The windows that are usable."""
    return [line for line in lines if usable(line)]


def fit(lines: Sequence[EnergyWindow], random: np.random.Generator) -> Fit:
    """Coefficients of REGRESSORS over "modt.energy/1" lines, each at least 0.

    Raises:
        FitError: too few windows, collinear regressors, or a coefficient whose whole interval is negative.
    """
    good = usable_windows(lines)
    n = len(good)
    p = len(REGRESSORS)
    X, scale = _scaled_counts(good)
    y = np.array([line.energy_J for line in good], np.float64)
    condition = float(np.linalg.cond(X))
    if condition > _MAX_CONDITION:
        raise FitError("the counts always varied together; vary rate and classification load independently")
    free, *_ = np.linalg.lstsq(X, y, rcond=None)
    spread = _bootstrap(X, y, random) - free
    # Resampling few windows underestimates the spread: widen by the ratio of Student's t to the normal quantile.
    wider = np.sqrt(n / (n - p)) * stats.t.ppf(_TAILS[1], n - p) / stats.norm.ppf(_TAILS[1])
    margin = wider * np.quantile(spread, _TAILS, axis=0)
    _refuse_negative(free / scale, *((free + margin) / scale))
    value = optimize.nnls(X, y)[0]
    residual = y - X @ value
    low, high = np.maximum(value + margin, 0.0)
    variance = float(np.sum((y - y.mean()) ** 2))
    return Fit(
        coefficients=tuple(
            Coefficient(r.name, float(v / s), float(a / s), float(b / s))
            for r, v, a, b, s in zip(REGRESSORS, value, low, high, scale, strict=True)
        ),
        windows=n,
        dropped=len(lines) - n,
        residual_J=float(np.sqrt(residual @ residual / (n - p))),
        explained=1.0 - float(residual @ residual) / variance if variance else 1.0,
        condition=condition,
    )


def _scaled_counts(windows: Sequence[EnergyWindow]) -> tuple[Float64, Float64]:
    """(n, p) counts of REGRESSORS in the windows, divided by (p,) their norms.

    Raises:
        FitError: too few windows, or nothing was counted.
    """
    least = 2 * len(REGRESSORS)
    if len(windows) < least:
        few = f"{len(windows)} usable windows are too few for {len(REGRESSORS)} coefficients"
        raise FitError(f"{few}; record at least {least}")
    X = np.array([[regressor.count(line) for regressor in REGRESSORS] for line in windows])
    scale = np.linalg.norm(X, axis=0)
    if not scale.all():
        missing = ", ".join(r.name for r, s in zip(REGRESSORS, scale, strict=True) if not s)
        raise FitError(f"nothing was counted for {missing}; vary its load")
    return X / scale, scale


def _refuse_negative(value: Float64, low: Float64, high: Float64) -> None:
    """Raises FitError where the whole interval of a coefficient is negative."""
    negative = ", ".join(
        f"{r.name} is {v:.3g} ({a:.3g} to {b:.3g})"
        for r, v, a, b in zip(REGRESSORS, value, low, high, strict=True)
        if b < 0
    )
    if negative:
        raise FitError(f"{negative}, but work gives no energy back: the readings do not follow the load")


def _bootstrap(X: Float64, y: Float64, random: np.random.Generator) -> Float64:
    """(_RESAMPLES, p) solutions over windows drawn with replacement."""
    n, p = X.shape
    weight = random.multinomial(n, np.full(n, 1 / n), size=_RESAMPLES).astype(float)
    normal = np.einsum("bn,np,nq->bpq", weight, X, X, optimize=True) + 1e-12 * np.eye(p)
    moment = weight @ (X * y[:, None])
    return np.asarray(np.linalg.solve(normal, moment[..., None])[..., 0])


def unit_energy_J(lines: Sequence[EnergyWindow], idle_W: float, work: Regressor) -> float | None:
    """Median of (energy - idle) / count over windows of that work alone; None without a usable window."""
    worked = [line for line in usable_windows(lines) if work.count(line) > 0]
    each = [((line.energy_J or 0.0) - idle_W * IDLE.count(line)) / work.count(line) for line in worked]
    return float(np.median(each)) if each else None
