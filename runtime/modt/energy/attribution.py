"""Energy of windows to energy of work: least squares over counts, with bootstrap intervals.

E_window = P_idle T + e_seg N_seg + e_class N_class + e_point N_point, over windows whose load was varied on purpose.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from modt.types import Float64

SPOILT = frozenset({"suspended", "clock", "lost", "back", "reset", "implausible", "ambiguous"})
"""Marks of windows that do not enter a fit."""
COLLINEAR = 1e6
"""Condition number of the scaled regressors beyond which they cannot be told apart."""
LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Term:
    """One regressor.

    Attributes:
        name: of its coefficient, with the unit.
        stage: that it counts; empty for the whole window.
        key: what it counts of the stage; of the window "wall_ns".
        scale: of the count, so that the coefficient has its unit.
    """

    name: str
    stage: str
    key: str
    scale: float = 1.0

    def count(self, line: dict[str, Any]) -> float:
        """Of one window."""
        row = line["stages"].get(self.stage, {}) if self.stage else line
        return self.scale * float(row.get(self.key, 0))


IDLE = Term("idle_W", "", "wall_ns", 1e-9)
SEG = Term("seg_J", "segmentation", "calls")
CLASS = Term("class_J", "classification", "items")
POINT = Term("point_J", "classification", "points")
TERMS = (IDLE, SEG, CLASS, POINT)


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A fitted figure with its interval at 95 %."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Fit:
    """What the windows say.

    Attributes:
        coefficients: one a term, in their order.
        windows: that entered.
        dropped: that did not, for want of a reading or because something happened in them.
        residual_J: standard deviation of what the fit leaves unexplained [J a window].
        explained: share of the variance explained, at most 1.
        condition: condition number of the scaled regressors.
    """

    coefficients: tuple[Coefficient, ...]
    windows: int
    dropped: int
    residual_J: float
    explained: float
    condition: float

    def __getitem__(self, name: str) -> Coefficient:
        return next(c for c in self.coefficients if c.name == name)


class FitError(Exception):
    """The windows do not determine the coefficients; it says what to vary."""


def usable(lines: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Windows with a reading in which nothing untoward happened."""
    return [line for line in lines if line["energy_J"] is not None and not SPOILT.intersection(line["marks"])]


def fit(
    lines: Sequence[dict[str, Any]],
    random: np.random.Generator,
    terms: Sequence[Term] = TERMS,
    resamples: int = 1000,
) -> Fit:
    """Coefficients of the terms over "modt.energy/1" lines.

    Raises:
        FitError: too few windows, or terms that always varied together.
    """
    good = usable(lines)
    X = np.array([[term.count(line) for term in terms] for line in good]).reshape(len(good), len(terms))
    y = np.array([line["energy_J"] for line in good])
    n, p = X.shape
    if n < 2 * p:
        raise FitError(f"{n} usable windows are too few for {p} coefficients; record at least {2 * p}")
    scale = np.linalg.norm(X, axis=0)
    if not scale.all():
        idle = ", ".join(t.name for t, s in zip(terms, scale, strict=True) if not s)
        raise FitError(f"nothing was counted for {idle}; vary its load")
    condition = float(np.linalg.cond(X / scale))
    if condition > COLLINEAR:
        raise FitError("the counts always varied together; vary rate and classification load independently")
    value, *_ = np.linalg.lstsq(X / scale, y, rcond=None)
    residual = y - X / scale @ value
    spread = _bootstrap(X / scale, y, random, resamples) - value
    low, high = value + _wider(n, p) * np.quantile(spread, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    variance = float(np.sum((y - y.mean()) ** 2))
    return Fit(
        coefficients=tuple(
            Coefficient(t.name, float(v / s), float(a / s), float(b / s))
            for t, v, a, b, s in zip(terms, value, low, high, scale, strict=True)
        ),
        windows=n,
        dropped=len(lines) - n,
        residual_J=float(np.sqrt(residual @ residual / (n - p))),
        explained=1.0 - float(residual @ residual) / variance if variance else 1.0,
        condition=condition,
    )


def _bootstrap(X: Float64, y: Float64, random: np.random.Generator, resamples: int) -> Float64:
    """(resamples, p) solutions over windows drawn with replacement."""
    n, p = X.shape
    weight = random.multinomial(n, np.full(n, 1 / n), size=resamples).astype(float)
    normal = np.einsum("bn,np,nq->bpq", weight, X, X, optimize=True) + 1e-12 * np.eye(p)
    moment = weight @ (X * y[:, None])
    solved: Float64 = np.linalg.solve(normal, moment[..., None])[..., 0]
    return solved


def _wider(n: int, p: int) -> float:
    """Factor that makes up for the spread that resampling loses when windows are few."""
    quantile = (1 + LEVEL) / 2
    return float(np.sqrt(n / (n - p)) * stats.t.ppf(quantile, n - p) / stats.norm.ppf(quantile))


def burst(lines: Sequence[dict[str, Any]], idle_W: float, term: Term) -> float | None:
    """Cross-check by ablation: energy of one unit of work, from windows in which only that work was done.

    Args:
        lines: windows of one stage run alone.
        idle_W: to be taken off [W].
        term: the work.

    Returns:
        Median over the windows of (energy - idle) / count [J]; None where no window can tell.
    """
    each = [
        (line["energy_J"] - idle_W * IDLE.count(line)) / term.count(line)
        for line in usable(lines)
        if term.count(line) > 0
    ]
    return float(np.median(each)) if each else None


class ByCoefficients:
    """Splits a window's energy by fitted coefficients; what they do not explain stays unattributed."""

    def __init__(self, values: dict[str, float]) -> None:
        self._terms = [(term, values[term.name]) for term in TERMS if term.name in values]

    def split(self, line: dict[str, Any]) -> dict[str, float]:
        """Energy of idling and of each stage [J]; the parts add up to the window's energy where that is known."""
        parts: dict[str, float] = {}
        for term, value in self._terms:
            name = term.stage or "idle"
            parts[name] = parts.get(name, 0.0) + value * term.count(line)
        if line["energy_J"] is not None:
            parts["unattributed"] = line["energy_J"] - sum(parts.values())
        return parts


class ByCpuTime:
    """Splits what is above idling by CPU time: an assumption, for code differs in power at equal time.

    Attributes:
        idle_W: drawn by the meter's scope while this process waits [W].
    """

    def __init__(self, idle_W: float) -> None:
        self.idle_W = idle_W

    def split(self, line: dict[str, Any]) -> dict[str, float]:
        """Energy of idling and of each stage [J]; the parts add up to the window's energy."""
        energy_J = line["energy_J"]
        if energy_J is None:
            return {}
        idle_J = min(self.idle_W * IDLE.count(line), energy_J)
        busy_ns = {stage: row["cpu_ns"] for stage, row in line["stages"].items()}
        rest_ns = max(line["process_ns"] - sum(busy_ns.values()), 0)
        total_ns = sum(busy_ns.values()) + rest_ns
        if not total_ns:
            return {"idle": energy_J}
        above_J = energy_J - idle_J
        parts = {stage: above_J * ns / total_ns for stage, ns in busy_ns.items()}
        return {"idle": idle_J, **parts, "unattributed": above_J * rest_ns / total_ns}
