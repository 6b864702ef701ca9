"""A comparison of the modes as a tree of quantities: energy, time, counts, gamma measured and reconciled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modt.config import EnergyConfig
from modt.energy.meters.meter import Facts, Kind, worst
from modt.energy.windows import EnergyWindow
from modt.pipeline import CLASSIFICATION, ODOMETRY, SEGMENTATION, STAGES, TRACKING
from modt.reporting.histogram import Histogram
from modt.types import Float64
from modt_profiling.comparison import gamma
from modt_profiling.comparison.comparison import COUNTS, Repetition, total
from modt_profiling.energy.board_fit import usable_windows
from modt_profiling.energy.run_energy import EnergySums, run_energy
from modt_profiling.energy.savings import OtherCosts, UnitCosts, reconcile
from modt_profiling.reporting.energy_plots import reconciliation_tree
from modt_profiling.reporting.quantity import Quantity, estimate, quantity

SCHEMA = "modt.compare/3"
_COUNTING = "Energy is assumed power times CPU time: the reconciliation tests counts and unit costs, not the physics."
_PHYSICS = "Energy is the meter's: the reconciliation is with the meter as a whole."


@dataclass(frozen=True)
class Basis:
    """The conversion of CPU time to energy."""

    board: EnergyConfig
    meter: Facts
    period_s: float


def compare_tree(
    repetitions: Sequence[Repetition], modes: Sequence[str], varied: str, basis: Basis, about: dict[str, Any]
) -> dict[str, Any]:
    """Results of a comparison over repetitions of the same stream.

    The first of the modes is tracking-by-detection. The run named `varied` gives the unit costs. `about` (stream,
    frames, conditions) is copied to the tree.
    """
    random = np.random.default_rng(0)
    passes = {name: [repetition[name] for repetition in repetitions] for name in (*modes, varied)}
    runs = {mode: gamma.RunCosts.median(passes[mode]) for mode in modes}
    windows = {mode: [line for run in passes[mode] for line in run.energy_lines] for mode in modes}
    attributed = {
        name: run_energy(
            (window for run in runs_of for window in run.energy_lines),
            (line for run in runs_of for line in run.lines),
            basis.board,
        )
        for name, runs_of in passes.items()
    }
    load_varied_run = gamma.RunCosts.median(passes[varied])
    baseline = runs[modes[0]]
    energy = {mode: _energy(run, windows[mode], attributed[mode], basis, random) for mode, run in runs.items()}
    savings = {
        mode: _saving(
            gamma.estimate_gamma(baseline, runs[mode], load_varied_run, random), energy[modes[0]], energy[mode]
        )
        | {"gamma_calibrated": estimate(_calibrated(baseline, runs[mode], basis))}
        for mode in modes[1:]
    }
    meter = basis.meter
    board = basis.board
    metered = all(e["gross_J"].kind is not Kind.ESTIMATED for e in energy.values())
    return {
        "schema": SCHEMA,
        **about,
        "meter": {"name": meter.name, "kind": meter.kind.value, "idle_W": board.idle_W, "busy_W": board.busy_W},
        "test": _PHYSICS if metered else _COUNTING,
        "modes": {mode: energy[mode] | _work(run, attributed[mode], random) for mode, run in runs.items()},
        "unit_costs": _costs(gamma.unit_costs(load_varied_run), baseline, attributed[varied]),
        "savings": savings,
        "calibration": {name: _table(run) for name, run in (*runs.items(), (varied, load_varied_run))},
        "series_kind": Kind.MEASURED.value,
        "series": {mode: _series(runs[mode], attributed[mode], repetitions[0][mode].lengths) for mode in modes},
    }


def _energy(
    run: gamma.RunCosts,
    windows: list[EnergyWindow],
    attributed: EnergySums,
    basis: Basis,
    random: np.random.Generator,
) -> dict[str, Quantity]:
    """Energy a frame with and without idling [J], by the meter if it was read, else by the model."""
    good = usable_windows(windows)
    frames = np.array([window.n_frames for window in good])
    if frames.sum():
        gross_J = np.array([window.energy_J for window in good], np.float64)
        net_J = gross_J - basis.board.idle_W * 1e-9 * np.array([window.wall_ns for window in good])

        def per_frame(energy_J: Float64, kind: Kind) -> Quantity:
            bounds = gamma.interval(len(good), lambda k: float(energy_J[k].sum() / max(frames[k].sum(), 1)), random)
            return quantity(float(energy_J.sum() / frames.sum()), "J", kind, bounds)

        kind = worst(window.kind for window in good)
        return {"net_J": per_frame(net_J, Kind.ESTIMATED), "gross_J": per_frame(gross_J, kind)}
    net_J = run.cost @ np.array([attributed.watts(stage) for stage in STAGES])
    gross_J = net_J + basis.board.idle_W * basis.period_s
    return {key: gamma.mean(J, "J", Kind.ESTIMATED, random) for key, J in (("net_J", net_J), ("gross_J", gross_J))}


def _work(run: gamma.RunCosts, energy: EnergySums, random: np.random.Generator) -> dict[str, Any]:
    def cpu_ms(cpu_s: Float64) -> Quantity:
        return gamma.mean(1e3 * cpu_s, "ms", Kind.MEASURED, random)

    counts = total(run.counts)
    stages = {
        stage: {
            "cpu_ms": cpu_ms(run.cost[:, k]),
            "energy_J": estimate(energy.watts(stage) * float(run.cost[:, k].mean()), "J"),
        }
        for k, stage in enumerate(STAGES)
    }
    return {
        "cpu_ms": cpu_ms(run.cost.sum(axis=1)),
        "stages": stages,
        "proposals": quantity(counts.n),
        "foreground": quantity(counts.n_obj),
        "classified": quantity(counts.classified / counts.frames),
        "beta": quantity(counts.beta),
        "N_go": quantity(counts.n_go, "frames"),
        "views": quantity(counts.classified / counts.tracks if counts.tracks else None),
    }


def _saving(found: gamma.GammaEstimate, energy1: dict[str, Quantity], energy2: dict[str, Quantity]) -> dict[str, Any]:
    net, gross = ((energy1[key].value, energy2[key].value) for key in ("net_J", "gross_J"))
    gamma_net, gamma_gross = (a / b if a is not None and b else None for a, b in (net, gross))
    saved_J = None if net[0] is None or net[1] is None else net[0] - net[1]
    reconciled = found.reconciliation
    return reconciliation_tree(reconciled, found.measured.value) | {
        "short_form_error": estimate(reconciled.paper.short_form_error),
        "gamma_reconciled": found.reconciled,
        "gamma_measured_cpu": found.measured,
        "gamma_net": estimate(gamma_net),
        "gamma_gross": quantity(gamma_gross, "", worst(e["gross_J"].kind for e in (energy1, energy2))),
        "deviation_net": estimate(reconciled.model.gamma / gamma_net - 1.0 if gamma_net else None),
        "deviation": found.deviation,
        "saved_J": estimate(saved_J, "J"),
    }


def _calibrated(baseline: gamma.RunCosts, run: gamma.RunCosts, basis: Basis) -> float | None:
    """Gamma from the joules of a calibration; stages not calibrated count by their CPU time."""
    if basis.board.coefficients is None:
        return None
    seg_J, class_J, point_J = basis.board.coefficients
    net_W = basis.board.active_W
    other1, other2 = (
        OtherCosts(net_W * c.track, net_W * c.schedule) for c in map(gamma.other_costs, (baseline, run))
    )
    costs = UnitCosts(seg_J, other1.track, 0.0, class_J, point_J)
    return reconcile(total(baseline.counts), total(run.counts), costs, other1, other2).model.gamma


def _costs(costs: UnitCosts, baseline: gamma.RunCosts, energy: EnergySums) -> dict[str, Quantity]:
    e_class = costs.e_class(total(baseline.counts))
    return {
        "E_seg": estimate(energy.watts(SEGMENTATION) * costs.seg, "J"),
        "E_class": estimate(energy.watts(CLASSIFICATION) * e_class, "J"),
        "E_track": estimate(energy.watts(ODOMETRY, TRACKING) * costs.track, "J"),
        "seg_cpu_ms": quantity(1e3 * costs.seg, "ms"),
        "class_cpu_ms": estimate(1e3 * e_class, "ms"),
        "track_cpu_ms": quantity(1e3 * costs.track, "ms"),
        "class_call_cpu_us": estimate(1e6 * costs.class_call, "us"),
        "class_item_cpu_us": estimate(1e6 * costs.class_item, "us"),
        "class_point_cpu_us": estimate(1e6 * costs.class_point, "us"),
        "a": estimate(e_class / costs.seg if costs.seg else None),
    }


def _table(run: gamma.RunCosts) -> dict[str, Any]:
    """Counts and costs of every frame, for predictions of other streams."""
    return {
        "counts": {name: run.counts[:, k].tolist() for k, name in enumerate(COUNTS)},
        "cpu_ms": _cpu_ms(run),
    }


def _cpu_ms(run: gamma.RunCosts) -> dict[str, list[float]]:
    """CPU time of every frame [ms] by stage."""
    return {stage: (1e3 * run.cost[:, k]).round(4).tolist() for k, stage in enumerate(STAGES)}


def _series(run: gamma.RunCosts, energy: EnergySums, lengths: Histogram) -> dict[str, Any]:
    return {
        "stage_W": energy.stage_watts(STAGES),
        "cpu_ms": _cpu_ms(run),
        "proposals": run.counts[:, COUNTS.index("proposals")].tolist(),
        "classified": run.counts[:, COUNTS.index("classified")].tolist(),
        "lives": lengths.occurrences(),
    }
