"""What a comparison of the modes says, as a tree of figures: energy, time, counts, gamma predicted and measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modt.energy.attribution import usable
from modt.energy.meters.meter import Kind
from modt.energy.savings import Beside, UnitCosts, predict
from modt.pipeline import STAGES
from modt.reporting.comparison import total
from modt.reporting.gamma import Evidence, Saving, beside_of, interval, mean_interval, saving, unit_costs
from modt.reporting.quantity import Figure, figure
from modt.reporting.repetitions import Trial, evidence, pooled, windows_of

SCHEMA = "modt.compare/1"
COUNTING = "Energy is watts assumed times CPU time: this tests counts and unit costs, not the physics."
PHYSICS = "Energy is the meter's: this tests the prediction as a whole."


@dataclass(frozen=True, slots=True)
class Basis:
    """What turns CPU time into energy.

    Attributes:
        idle_W: drawn while the process waits.
        busy_W: drawn while it computes.
        period_s: of the stream, over which idling is counted.
        meter: name of the meter.
        kind: of its energy.
        coefficients: seg_J, class_J and point_J of a calibration, None without one.
    """

    idle_W: float
    busy_W: float
    period_s: float
    meter: str
    kind: Kind
    coefficients: tuple[float, float, float] | None = None

    @property
    def net_W(self) -> float:
        """What computing adds."""
        return self.busy_W - self.idle_W


def compare_tree(
    trials: Sequence[Trial], modes: Sequence[str], varied: str, basis: Basis, about: dict[str, Any]
) -> dict[str, Any]:
    """Everything a comparison found.

    Args:
        trials: of the same stream.
        modes: compared, the first of them tracking-by-detection.
        varied: the contender whose costs price the others.
        basis: for joules.
        about: stream, frames, conditions, for the record.
    """
    random = np.random.default_rng(0)
    runs = {mode: evidence(trials, mode) for mode in modes}
    priced = pooled(trials, varied)
    baseline = runs[modes[0]]
    energy = {mode: _energy(run, windows_of(trials, mode), basis, random) for mode, run in runs.items()}
    savings = {
        mode: _saving(
            saving(baseline, runs[mode], priced, random), baseline, runs[mode], energy, modes[0], mode, basis
        )
        for mode in modes[1:]
    }
    metered = all(e["net_J"].kind is not Kind.ESTIMATED for e in energy.values())
    return {
        "schema": SCHEMA,
        **about,
        "meter": {"name": basis.meter, "kind": basis.kind.value, "idle_W": basis.idle_W, "busy_W": basis.busy_W},
        "test": PHYSICS if metered else COUNTING,
        "modes": {mode: energy[mode] | _work(runs[mode], energy[mode], random) for mode in modes},
        "unit_costs": _costs(unit_costs(priced), baseline, basis),
        "savings": savings,
        "series_kind": Kind.MEASURED.value,
        "series": {mode: _series(runs[mode], trials[0][mode].lives) for mode in modes},
    }


def _energy(
    run: Evidence, windows: list[dict[str, Any]], basis: Basis, random: np.random.Generator
) -> dict[str, Figure]:
    """Joules a frame, with and without idling: the meter's where it read, the model's elsewhere."""
    good = usable(windows)
    frames = sum(line["frames"][2] for line in good)
    if frames:
        gross_J = np.array([line["energy_J"] for line in good])
        net_J = gross_J - basis.idle_W * 1e-9 * np.array([line["wall_ns"] for line in good])
        each = np.array([line["frames"][2] for line in good])
        kind = Kind(good[0]["kind"])

        def per_frame(values: Any, rows: Any) -> float:
            return float(values[rows].sum() / max(each[rows].sum(), 1))

        return {
            name: figure(
                float(values.sum() / frames),
                "J",
                kind,
                interval(len(good), lambda rows, v=values: per_frame(v, rows), random),  # type: ignore[misc]
            )
            for name, values in (("net_J", net_J), ("gross_J", gross_J))
        }
    cpu_s = run.cost.sum(axis=1)
    low, high = mean_interval(cpu_s, random)
    net, idle = basis.net_W, basis.idle_W * basis.period_s
    mean = float(cpu_s.mean())
    return {
        "net_J": figure(net * mean, "J", Kind.ESTIMATED, (net * low, net * high)),
        "gross_J": figure(idle + net * mean, "J", Kind.ESTIMATED, (idle + net * low, idle + net * high)),
    }


def _work(run: Evidence, energy: dict[str, Figure], random: np.random.Generator) -> dict[str, Any]:
    counts, cpu_s = total(run.counts), run.cost.sum(axis=1)
    net_J, total_s = energy["net_J"].value, float(cpu_s.mean())
    stages = {}
    for k, stage in enumerate(STAGES):
        mean = float(run.cost[:, k].mean())
        share_J = None if net_J is None or not total_s else net_J * mean / total_s
        stages[stage] = {
            "cpu_ms": figure(1e3 * mean, "ms", Kind.MEASURED, _scaled(mean_interval(run.cost[:, k], random), 1e3)),
            "energy_J": figure(share_J, "J", Kind.ESTIMATED),
        }
    return {
        "cpu_ms": figure(1e3 * total_s, "ms", Kind.MEASURED, _scaled(mean_interval(cpu_s, random), 1e3)),
        "stages": stages,
        "proposals": figure(counts.n),
        "foreground": figure(counts.n_obj),
        "classified": figure(counts.classified / counts.frames),
        "beta": figure(counts.beta),
        "N_go": figure(counts.n_go, "frames"),
        "views": figure(counts.classified / counts.tracks if counts.tracks else None),
    }


def _saving(
    found: Saving,
    baseline: Evidence,
    run: Evidence,
    energy: dict[str, dict[str, Figure]],
    base: str,
    mode: str,
    basis: Basis,
) -> dict[str, Any]:
    p = found.prediction
    gross1, gross2 = (energy[m]["gross_J"] for m in (base, mode))
    net1, net2 = (energy[m]["net_J"] for m in (base, mode))
    return {
        "a": figure(p.paper.a, "", Kind.ESTIMATED),
        "gamma_short": figure(p.paper.gamma_short, "", Kind.ESTIMATED),
        "gamma_equation_3": figure(p.paper.gamma, "", Kind.ESTIMATED),
        "short_form_error": figure(p.paper.short_form_error, "", Kind.ESTIMATED),
        "gamma_predicted": figure(found.predicted, "", Kind.ESTIMATED, found.predicted_interval),
        "gamma_measured_cpu": figure(found.measured, "", Kind.MEASURED, found.measured_interval),
        "gamma_net": figure(_ratio(net1, net2), "", net1.kind),
        "gamma_gross": figure(_ratio(gross1, gross2), "", gross1.kind),
        "deviation_net": figure(_off(found.predicted, _ratio(net1, net2)), "", Kind.ESTIMATED),
        "gamma_calibrated": figure(_calibrated(baseline, run, basis), "", Kind.ESTIMATED),
        "deviation": figure(found.deviation, "", Kind.ESTIMATED, found.deviation_interval),
        "terms": [
            {
                "name": t.name,
                "change": figure(t.change, "", Kind.ESTIMATED),
                "gamma": figure(t.gamma, "", Kind.ESTIMATED),
            }
            for t in p.explain(found.measured)
        ],
        "saved_J": figure(_difference(net1, net2), "J", net1.kind),
    }


def _calibrated(baseline: Evidence, run: Evidence, basis: Basis) -> float | None:
    """Gamma from a calibration's joules; what was not calibrated is priced by its CPU time."""
    if basis.coefficients is None:
        return None
    seg_J, class_J, point_J = basis.coefficients
    beside1, beside2 = (
        Beside(basis.net_W * b.track, basis.net_W * b.choose) for b in (beside_of(baseline), beside_of(run))
    )
    costs = UnitCosts(seg_J, beside1.track, 0.0, class_J, point_J)
    return predict(total(baseline.counts), total(run.counts), costs, beside1, beside2).model.gamma


def _costs(costs: UnitCosts, baseline: Evidence, basis: Basis) -> dict[str, Figure]:
    e_class = costs.e_class(total(baseline.counts))
    return {
        "E_seg": figure(basis.net_W * costs.seg, "J", Kind.ESTIMATED),
        "E_class": figure(basis.net_W * e_class, "J", Kind.ESTIMATED),
        "E_track": figure(basis.net_W * costs.track, "J", Kind.ESTIMATED),
        "seg_cpu_ms": figure(1e3 * costs.seg, "ms"),
        "class_cpu_ms": figure(1e3 * e_class, "ms", Kind.ESTIMATED),
        "track_cpu_ms": figure(1e3 * costs.track, "ms"),
        "class_call_cpu_us": figure(1e6 * costs.class_call, "us", Kind.ESTIMATED),
        "class_item_cpu_us": figure(1e6 * costs.class_item, "us", Kind.ESTIMATED),
        "class_point_cpu_us": figure(1e6 * costs.class_point, "us", Kind.ESTIMATED),
        "a": figure(e_class / costs.seg if costs.seg else None, "", Kind.ESTIMATED),
    }


def _series(run: Evidence, lives: list[int]) -> dict[str, Any]:
    return {
        "cpu_ms": {stage: (1e3 * run.cost[:, k]).round(4).tolist() for k, stage in enumerate(STAGES)},
        "proposals": run.counts[:, 0].tolist(),
        "classified": run.counts[:, 4].tolist(),
        "lives": sorted(lives),
    }


def _scaled(pair: tuple[float, float], by: float) -> tuple[float, float]:
    return by * pair[0], by * pair[1]


def _ratio(a: Figure, b: Figure) -> float | None:
    return None if a.value is None or not b.value else a.value / b.value


def _off(predicted: float, measured: float | None) -> float | None:
    return predicted / measured - 1.0 if measured else None


def _difference(a: Figure, b: Figure) -> float | None:
    return None if a.value is None or b.value is None else a.value - b.value
