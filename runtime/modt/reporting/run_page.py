"""The report of a run as an HTML page."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.reporting import energy_plots, svg
from modt.reporting.compare_text import conditions_text
from modt.reporting.page import Plot, page, plots, table, tiles


def run_page(tree: dict[str, Any]) -> str:
    """HTML of the tree of run_tree."""
    saved, meter = tree["saved"], tree["meter"]
    subtitle = (
        f"{tree['frames']} frames, mode {tree['mode']}, field of view {tree['fov']}; "
        f"meter: {meter['name']} ({meter['kind']}); {conditions_text(tree['conditions'])}"
        + ("" if tree["ended"] else "; still running or cut short")
    )
    gross, net = (tree[key].with_kind(1e3, "mJ") for key in ("gross_J", "net_J"))
    results = [
        ("energy a frame", gross, f"{net} without idling"),
        ("power", tree["power_W"].with_kind(), tree["test"]),
        ("gamma", saved["gamma_of_this_run"].with_kind(), f"predicted {saved['gamma_predicted'].with_kind()}"),
        ("beta", saved["beta"].with_kind(100, "%"), f"N_go {saved['N_go'].with_kind()}"),
    ]
    note = "E1 is computed from this run's own costs; modt-profile compare measures it"
    terms = energy_plots.gamma_terms("From N_go to gamma", saved, note)
    title = f"Energy of {tree['stream']}, {tree['mode']}"
    return page(title, subtitle, [tiles(results), _stages(tree), plots(_plots(tree)), terms, _ledger(tree)])


def _stages(tree: dict[str, Any]) -> str:
    keys = {"cpu_ms": "cpu", "wall_ms": "wall", "calls": "calls", "items": "items", "points": "points"}
    rows = []
    for name in dict.fromkeys([*tree["parts_J"], *tree["cpu"]]):
        energy, times = tree["parts_J"].get(name), tree["cpu"].get(name)
        cells = [times[key].with_kind() if times else "-" for key in keys]
        rows.append([name, energy.with_kind(1e3, "mJ") if energy else "-", *cells])
    return table("Distribution over the stages", ["", "energy a frame", *keys.values()], rows, tree["test"])


def _ledger(tree: dict[str, Any]) -> str:
    rows = [[name, value.with_kind()] for name, value in tree["ledger"].items()]
    note = f"marks: {', '.join(tree['marks']) or 'none'}; windows dropped: {tree['dropped_windows']}"
    return table("Cost of the ledger", ["", ""], rows, note)


def _plots(tree: dict[str, Any]) -> list[Plot]:
    series, saved = tree["series"], tree["saved"]
    frames = np.arange(tree["frames"], dtype=float)
    parts_mJ = energy_plots.stage_energy_mJ(series, series["net_W"])
    baseline = "E1, tracking-by-detection (computed)"
    energy_mJ = {
        baseline: series["net_W"] * np.array(series["predicted_cpu_ms"], float),
        "E2, this run": np.sum([*parts_mJ.values()], axis=0),
    }
    budget = [svg.Trace(key, frames, np.array(series[key], float)) for key in ("classified", "deferred")]
    if series["budget"] is not None:
        budget.append(svg.Trace("budget", frames[[0, -1]], np.full(2, float(series["budget"])), dashed=True))
    point = {tree["mode"]: (saved["N_go"], saved["gamma_of_this_run"])}
    return [
        energy_plots.stage_energy("Energy by stage", parts_mJ),
        energy_plots.cumulative_energy(energy_mJ, "estimated", dashed=baseline),
        energy_plots.gamma_curve(saved["a"], saved["proposals"], point, "dot: this run"),
        energy_plots.life_histogram("Life of tracks", series["lives"]),
        ("Use of the budget", svg.lines(budget, "frame", "proposals"), "measured"),
    ]
