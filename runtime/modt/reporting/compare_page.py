"""A comparison of the modes as an HTML page."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.reporting import energy_plots, svg
from modt.reporting.compare_text import conditions_text, verdict
from modt.reporting.page import Plot, page, plots, table, tiles


def compare_page(tree: dict[str, Any]) -> str:
    """HTML of the tree of compare_tree."""
    modes, savings, meter = tree["modes"], tree["savings"], tree["meter"]
    subtitle = (
        f"{tree['frames']} frames, field of view {tree['fov']}, {tree['repeat']} repetitions, modes interleaved; "
        f"meter: {meter['name']} ({meter['kind']}); {conditions_text(tree['conditions'])}"
    )
    results = [
        (
            f"{mode}: energy a frame",
            m["net_J"].with_kind(1e3, "mJ"),
            f"{m['gross_J'].with_kind(1e3, 'mJ')} with idling",
        )
        for mode, m in modes.items()
    ]
    results += [
        (f"{m}: gamma of CPU energy", s["gamma_measured_cpu"].with_kind(), verdict(s)) for m, s in savings.items()
    ]
    terms = (
        energy_plots.gamma_terms(f"{mode}: from N_go to the measured gamma", s, verdict(s))
        for mode, s in savings.items()
    )
    return page(
        f"Energy of {tree['stream']}",
        subtitle,
        [tiles(results), _modes(tree), plots(_plots(tree)), *terms, _unit_costs(tree)],
    )


def _modes(tree: dict[str, Any]) -> str:
    modes = tree["modes"].values()
    stages = next(iter(modes))["stages"]
    rows = [["cpu a frame", *(m["cpu_ms"].with_kind() for m in modes)]]
    rows += [[f"  {s}", *(m["stages"][s]["cpu_ms"].with_kind() for m in modes)] for s in stages]
    rows += [[f"energy of {s}", *(m["stages"][s]["energy_J"].with_kind(1e3, "mJ") for m in modes)] for s in stages]
    keys = {"beta": "beta", "N_go": "N_go", "proposals a frame": "proposals", "views a track": "views"}
    rows += [[name, *(m[key].with_kind() for m in modes)] for name, key in keys.items()]
    return table("Distribution over the stages", ["a frame", *tree["modes"]], rows, tree["test"])


def _unit_costs(tree: dict[str, Any]) -> str:
    rows = [[name, value.with_kind()] for name, value in tree["unit_costs"].items()]
    return table("Unit costs", ["unit", "cost"], rows, "from the run of varied classification load")


def _plots(tree: dict[str, Any]) -> list[Plot]:
    series, modes = tree["series"], tree["modes"]
    base, *others = series
    net_W = tree["meter"]["busy_W"] - tree["meter"]["idle_W"]
    energy_mJ = {mode: energy_plots.stage_energy_mJ(series[mode], net_W) for mode in series}
    sums_mJ = {mode: np.sum([*parts.values()], axis=0) for mode, parts in energy_mJ.items()}
    points = {mode: (modes[mode]["N_go"], s["gamma_measured_cpu"]) for mode, s in tree["savings"].items()}
    frames = np.arange(tree["frames"], dtype=float)
    classified = [svg.Trace(mode, frames, np.array(series[mode]["classified"], float)) for mode in series]
    return [
        energy_plots.cumulative_energy(sums_mJ, f"E1: {base}; estimated from CPU time, without idling"),
        energy_plots.gamma_curve(tree["unit_costs"]["a"], modes[base]["proposals"], points, "dots: measured"),
        *(energy_plots.stage_energy(f"{mode}: energy by stage", parts) for mode, parts in energy_mJ.items()),
        *(energy_plots.life_histogram(f"{mode}: life of tracks", series[mode]["lives"]) for mode in others),
        ("Classifications a frame", svg.lines(classified, "frame", "classified"), "measured"),
    ]
