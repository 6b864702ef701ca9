"""The report of a run for people: results, tables and plots."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.pipeline import CLASSIFICATION
from modt.reporting import energy_plots, svg
from modt.reporting.document import Cell, Document, Table
from modt.reporting.page import Plot
from modt.reporting.quantity import Quantity


def run_document(tree: dict[str, Any]) -> Document:
    """Energy a frame and power, their distribution, the energy saved, and what gamma is made of."""
    saved, meter, ledger = tree["saved"], tree["meter"], tree["ledger"]
    net_mJ = tree["net_J"].scaled(1e3, "mJ")
    of_e1 = "E1 is computed from this run's own costs; modt-profile compare measures it"
    if tree["mode"] == "conventional":
        of_e1 = "this is tracking-by-detection itself: nothing was saved; run the other modes, or compare"
    said = {key: value.marked() for key, value in saved.items() if isinstance(value, Quantity)}
    gross = f"{net_mJ.marked()} without idling; power {tree['power_W'].marked()}"
    computed = (
        f"computed from this run: {said['gamma_reconciled']} in full, {said['gamma_equation_3']} by Equation 3, "
        f"{said['gamma_short']} by N_go alone; a = {said['a']}"
    )
    counts = f"{said['proposals']} proposals a frame, N_go {said['N_go']}, {said['views']} classifications a track"
    share = f"{ledger['overhead_share'].scaled(100, '%').marked()} of the CPU time"
    results = [
        ("energy a frame", tree["gross_J"].scaled(1e3, "mJ"), gross),
        ("saved a frame", saved["saved_J"].scaled(1e3, "mJ"), of_e1),
        ("gamma", saved["gamma_of_this_run"], computed),
        ("beta", saved["beta"].scaled(100, "%"), counts),
        ("overhead of the ledger a frame", ledger["overhead_us"], share),
    ]
    about = [
        f"{tree['frames']} frames, mode {tree['mode']}, field of view {tree['fov']}",
        f"meter: {meter['name']} ({meter['kind']}), {meter['windows']} windows, {tree['dropped_windows']} dropped",
        energy_plots.conditions_text(tree["conditions"]),
    ]
    if not tree["ended"]:
        about.append("still running or cut short")
    if tree["marks"]:
        about.append(f"marked: {', '.join(tree['marks'])}")
    tables = [_stages(tree), energy_plots.gamma_terms("from N_go to gamma", saved)]
    return Document(f"Energy of {tree['stream']}, {tree['mode']}", about, results, tables, tree["test"])


def _stages(tree: dict[str, Any]) -> Table:
    keys = {"cpu_ms": "cpu", "wall_ms": "wall", "calls": "calls", "items": "items", "points": "points"}
    parts, times = tree["parts_J"], tree["cpu"]
    whole = sum(part.value or 0.0 for part in parts.values()) or 1.0
    rows: list[list[Cell]] = []
    for name in dict.fromkeys([*parts, *times]):
        energy: list[Cell] = ["-", "-"]
        if name in parts:
            energy = [parts[name].scaled(1e3, "mJ"), parts[name].scaled(100 / whole, "%")]
        work = {key: q for key, q in times.get(name, {}).items() if key != "points" or q.value}
        rows.append([name, *energy, *(work.get(key, "-") for key in keys)])
    return Table(["stage", "energy a frame", "share", *keys.values()], rows)


def run_plots(tree: dict[str, Any]) -> list[Plot]:
    """Plots over frames, over N_go and over the life of tracks."""
    series, saved = tree["series"], tree["saved"]
    each = np.array(series["frames"], float)
    frames = np.cumsum(each) - each
    parts_mJ, basis = energy_plots.stage_energy_mJ(series), energy_plots.basis(tree["net_J"])
    baseline, run_mJ = "E1, tracking-by-detection (computed)", np.sum([*parts_mJ.values()], axis=0)
    further_ms = np.array(series["e1_cpu_ms"]) - np.sum([*series["cpu_ms"].values()], axis=0)  # of classification
    energy_mJ = {baseline: run_mJ + series["stage_W"][CLASSIFICATION] * further_ms, "E2, this run": run_mJ}
    budget = [svg.Trace(key, frames, np.array(series[key], float)) for key in ("classified", "deferred")]
    if series["budget"] is not None:
        budget.append(svg.Trace("budget", frames[[0, -1]], np.full(2, float(series["budget"])), dashed=True))
    point = {tree["mode"]: (saved["N_go"], saved["gamma_of_this_run"])}
    return [
        energy_plots.stage_energy("Energy by stage", parts_mJ, frames, basis),
        energy_plots.cumulative_energy(energy_mJ, each, f"E2: {basis}; E1: estimated", dashed=baseline),
        energy_plots.gamma_curve(saved["a"], saved["proposals"], point, "dot: this run"),
        energy_plots.life_histogram("Life of tracks", series["lives"]),
        ("Use of the budget", svg.lines(budget, "frame", "proposals"), "measured"),
    ]
