"""Attribution of the energy of windows to work: the coefficients of a board, and the joules of each stage.

E_window = P_idle T + e_seg N_seg + e_class N_class + e_point N_point, by non-negative least squares over windows
whose load was varied on purpose, with bootstrap intervals. `attribute` is the one rule by which reports split energy.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modt.config import EnergyConfig
from modt.energy.ledger import Line
from modt.energy.meters.meter import Kind, model_J, model_name, worst
from modt.types import Float64

_HARMLESS_MARKS = frozenset({"wrap", "clock-step"})
_MAX_W = 10_000.0
"""Power above which the record of a window is not believed [W]."""
_MAX_CONDITION = 1e6
"""Condition number of the scaled regressors above which they are collinear."""
_TAILS = (0.025, 0.975)
"""Quantiles of the intervals at 95 %."""


@dataclass(frozen=True, slots=True)
class Regressor:
    """One count of a window: an entry of a stage, or of the whole window where the stage is empty."""

    name: str  # of its coefficient, with the unit
    stage: str
    key: str
    scale: float = 1.0  # of the count, so that the coefficient has its unit

    def count(self, line: Line) -> float:
        """Count of one window."""
        row = line["stages"].get(self.stage, {}) if self.stage else line
        return self.scale * float(row.get(self.key, 0))


IDLE = Regressor("idle_W", "", "wall_ns", 1e-9)
SEG = Regressor("seg_J", "segmentation", "calls")
CLASS = Regressor("class_J", "classification", "items")
POINT = Regressor("point_J", "classification", "points")
REGRESSORS = (IDLE, SEG, CLASS, POINT)


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A fitted value with its interval at 95 %."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
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


def usable(line: Line) -> bool:
    """Whether a window has a reading that can be true, and no mark that forbids its use."""
    energy_J = line["energy_J"]
    known = energy_J is not None and _HARMLESS_MARKS.issuperset(line.get("marks", ()))
    return known and 0.0 <= energy_J <= _MAX_W * IDLE.count(line)


def usable_windows(lines: Iterable[Line]) -> list[Line]:
    """The windows that are usable."""
    return [line for line in lines if usable(line)]


def fit(lines: Sequence[Line], random: np.random.Generator, resamples: int = 1000) -> Fit:
    """Coefficients of REGRESSORS over "modt.energy/1" lines, each at least 0.

    Raises:
        FitError: too few windows, collinear regressors, or a coefficient whose whole interval is negative.
    """
    good = usable_windows(lines)
    n, p = len(good), len(REGRESSORS)
    if n < 2 * p:
        raise FitError(f"{n} usable windows are too few for {p} coefficients; record at least {2 * p}")
    X = np.array([[regressor.count(line) for regressor in REGRESSORS] for line in good])
    y = np.array([line["energy_J"] for line in good])
    scale = np.linalg.norm(X, axis=0)
    if not scale.all():
        missing = ", ".join(r.name for r, s in zip(REGRESSORS, scale, strict=True) if not s)
        raise FitError(f"nothing was counted for {missing}; vary its load")
    X /= scale
    condition = float(np.linalg.cond(X))
    if condition > _MAX_CONDITION:
        raise FitError("the counts always varied together; vary rate and classification load independently")
    free, *_ = np.linalg.lstsq(X, y, rcond=None)
    spread = _bootstrap(X, y, random, resamples) - free
    from scipy import optimize, stats  # large, and a service only splits

    # Resampling few windows underestimates the spread: widen by the ratio of Student's t to the normal quantile.
    wider = np.sqrt(n / (n - p)) * stats.t.ppf(_TAILS[1], n - p) / stats.norm.ppf(_TAILS[1])
    margin = wider * np.quantile(spread, _TAILS, axis=0)
    negative = ", ".join(
        f"{r.name} is {v:.3g} ({a:.3g} to {b:.3g})"
        for r, v, a, b in zip(REGRESSORS, free / scale, *((free + margin) / scale), strict=True)
        if b < 0
    )
    if negative:
        raise FitError(f"{negative}, but work gives no energy back: the readings do not follow the load")
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


def _bootstrap(X: Float64, y: Float64, random: np.random.Generator, resamples: int) -> Float64:
    """(resamples, p) solutions over windows drawn with replacement."""
    n, p = X.shape
    weight = random.multinomial(n, np.full(n, 1 / n), size=resamples).astype(float)
    normal = np.einsum("bn,np,nq->bpq", weight, X, X, optimize=True) + 1e-12 * np.eye(p)
    moment = weight @ (X * y[:, None])
    solved: Float64 = np.linalg.solve(normal, moment[..., None])[..., 0]
    return solved


def unit_energy_J(lines: Sequence[Line], idle_W: float, work: Regressor) -> float | None:
    """Median of (energy - idle) / count over windows of that work alone; None without a usable window."""
    worked = [line for line in usable_windows(lines) if work.count(line) > 0]
    each = [(line["energy_J"] - idle_W * IDLE.count(line)) / work.count(line) for line in worked]
    return float(np.median(each)) if each else None


def attribute(line: Line, board: EnergyConfig) -> dict[str, float]:
    """Energy of idling, of each stage, and of the rest of a window, unattributed [J]; none without a reading.

    With P_idle of the board, E and T of the window and t of its CPU time, in all and of a stage,

        E_idle = min(P_idle T, E)
        E_stage = (E - E_idle) t_stage / t

    A reading of a calibrated board is split by the coefficients instead: E_idle = P_idle T,
    E_segmentation = e_seg N_seg, E_classification = e_class N_class + e_point N_point, the rest is unattributed.
    The parts sum to E.
    """
    energy_J = line["energy_J"]
    if energy_J is None:
        return {}
    if board.coefficients is not None and line["kind"] != Kind.ESTIMATED:
        parts: dict[str, float] = {}
        for regressor, value in zip(REGRESSORS, (board.idle_W, *board.coefficients), strict=True):
            name = regressor.stage or "idle"
            parts[name] = parts.get(name, 0.0) + value * regressor.count(line)
        return parts | {"unattributed": energy_J - sum(parts.values())}
    cpu_ns = {stage: row["cpu_ns"] for stage, row in line["stages"].items()}
    cpu_ns["unattributed"] = max(line["process_ns"] - sum(cpu_ns.values()), 0)
    total_ns = sum(cpu_ns.values())
    if not total_ns:
        return {"idle": energy_J}
    idle_J = min(board.idle_W * IDLE.count(line), energy_J)
    return {"idle": idle_J, **{name: (energy_J - idle_J) * ns / total_ns for name, ns in cpu_ns.items()}}


def modelled(line: Line, board: EnergyConfig) -> Line:
    """A frame's ledger line as a window of one frame, with the energy of the power model."""
    return line | {
        "frames": [line["frame"], line["frame"], 1],
        "process_ns": line["cpu_ns"],
        "energy_J": model_J(board.idle_W, board.busy_W, line["wall_ns"], line["cpu_ns"]),
        "kind": Kind.ESTIMATED.value,
        "resolution_J": 0.0,
        "meters": [{"name": model_name(board.idle_W, board.busy_W)}],
    }


class EnergySums:
    """Energy of windows or of modelled frames, summed."""

    def __init__(self, board: EnergyConfig) -> None:
        self._board = board
        self.count = self.frames = self.wall_ns = self.dropped = 0
        self.gross_J = self.error2_J2 = 0.0
        self.parts_J: Counter[str] = Counter()
        self._cpu_ns: Counter[str] = Counter()  # of the stages
        self.kind, self.meter = Kind.ESTIMATED, ""
        self.conditions: dict[str, Any] = {}  # of the last window
        self.marks: set[str] = set()

    def add_window(self, window: Line) -> None:
        """Add a line of modt.energy; one that is not usable is counted as dropped."""
        self.conditions = window["conditions"]
        self.marks.update(window["marks"])
        if not usable(window):
            self.dropped += 1
            self.marks.update(() if window["energy_J"] is None or window["marks"] else {"implausible"})
        elif window["frames"][2]:
            self._add(window)

    def add_frame(self, line: Line) -> None:
        """Add a frame of the ledger by the power model."""
        self._add(modelled(line, self._board))

    def watts(self, *stages: str) -> float:
        """Power above idling while the stages compute: their energy over their CPU time; NaN where it has no part."""
        ran = [stage for stage in stages if self._cpu_ns[stage]]
        joules = sum(self.parts_J.get(stage, math.nan) for stage in ran)
        return 1e9 * joules / sum(self._cpu_ns[stage] for stage in ran) if ran else 0.0

    def stage_watts(self, stages: Iterable[str]) -> dict[str, float]:
        """The same of each of these stages, without those that have no part."""
        return {stage: watts for stage in stages if not math.isnan(watts := self.watts(stage))}

    def _add(self, window: Line) -> None:
        self.kind = worst([Kind(window["kind"]), *([self.kind] if self.count else [])])
        self.meter = self.meter or window["meters"][0]["name"]
        self.count += 1
        self.frames += window["frames"][2]
        self.wall_ns += window["wall_ns"]
        self.gross_J += window["energy_J"]
        self.error2_J2 += window["resolution_J"] ** 2
        self.parts_J.update(attribute(window, self._board))
        self._cpu_ns.update({stage: row["cpu_ns"] for stage, row in window["stages"].items()})


def run_energy(windows: Iterable[Line], frames: Iterable[Line], board: EnergyConfig) -> EnergySums:
    """Energy of a run: of its windows where a meter was read, else of its frames by the power model."""
    sums = EnergySums(board)
    for window in windows:
        sums.add_window(window)
    if not sums.count:
        for line in frames:
            sums.add_frame(line)
    return sums
