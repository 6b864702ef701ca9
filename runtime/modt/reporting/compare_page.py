"""A comparison as a page."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.energy.prediction import gamma
from modt.reporting import svg
from modt.reporting.compare_text import conditions_text, holds
from modt.reporting.page import page, plots, table, tiles
from modt.reporting.quantity import Figure, brief

LONGEST = 1000.0
"""Life of a track up to which the prediction's curve is drawn [frames]."""


def compare_page(tree: dict[str, Any]) -> str:
    """The page."""
    modes, savings = tree["modes"], tree["savings"]
    about = (
        f"{tree['frames']} frames, field of view {tree['fov']}, {tree['repeat']} times in turns; "
        f"meter: {tree['meter']['name']} ({tree['meter']['kind']}); {conditions_text(tree['conditions'])}"
    )
    answers = [
        (f"{mode}: energy a frame", kinded(m["net_J"], 1e3, "mJ"), f"{kinded(m['gross_J'], 1e3, 'mJ')} with idling")
        for mode, m in modes.items()
    ]
    answers += [
        (f"{mode}: gamma of CPU energy", kinded(s["gamma_measured_cpu"]), holds(s)) for mode, s in savings.items()
    ]
    return page(
        f"Energy of {tree['stream']}",
        about,
        [
            tiles(answers),
            _modes(tree),
            plots(_plots(tree)),
            *(_terms(m, s) for m, s in savings.items()),
            _units(tree),
        ],
    )


def kinded(figure: Figure, by: float = 1.0, unit: str | None = None) -> str:
    """Value, unit and kind."""
    if figure.value is None:
        return "unavailable"
    return f"{brief(by * figure.value)} {figure.unit if unit is None else unit}".rstrip() + f" ({figure.kind.value})"


def _modes(tree: dict[str, Any]) -> str:
    modes = tree["modes"]
    rows = [["cpu a frame", *(kinded(m["cpu_ms"]) for m in modes.values())]]
    rows += [
        [f"  {stage}", *(kinded(m["stages"][stage]["cpu_ms"]) for m in modes.values())]
        for stage in next(iter(modes.values()))["stages"]
    ]
    rows += [
        [f"energy of {stage}", *(kinded(m["stages"][stage]["energy_J"], 1e3, "mJ") for m in modes.values())]
        for stage in next(iter(modes.values()))["stages"]
    ]
    for name, key in (
        ("beta", "beta"),
        ("N_go", "N_go"),
        ("proposals a frame", "proposals"),
        ("views a track", "views"),
    ):
        rows.append([name, *(kinded(m[key]) for m in modes.values())])
    return table("Where it goes", ["a frame", *modes], rows, tree["test"])


def _terms(mode: str, saving: dict[str, Any]) -> str:
    rows = [["the short form, gamma = N_go", "", kinded(saving["gamma_short"])]]
    rows += [[t["name"], f"{t['change'].value:+.3f}", kinded(t["gamma"])] for t in saving["terms"]]
    return table(f"{mode}: from N_go to what was measured", ["reason", "change", "gamma"], rows, holds(saving))


def _units(tree: dict[str, Any]) -> str:
    rows = [[name, kinded(value)] for name, value in tree["unit_costs"].items()]
    return table(
        "What a unit of work costs", ["unit", "cost"], rows, "from the run whose classification load was varied"
    )


def _plots(tree: dict[str, Any]) -> list[tuple[str, str, str]]:
    net_mW = 1e3 * (tree["meter"]["busy_W"] - tree["meter"]["idle_W"])
    series = tree["series"]
    base, *others = series
    frames = np.arange(tree["frames"], dtype=float)

    def energy_mJ(mode: str) -> Any:
        return 1e-3 * net_mW * sum(np.array(v) for v in series[mode]["cpu_ms"].values())

    cumulative = [svg.Trace(f"{mode}", frames, 1e-3 * np.cumsum(energy_mJ(mode))) for mode in series]
    drawn = [
        (
            "Cumulative energy, E1 against E2",
            svg.lines(cumulative, "frame", "J"),
            f"E1: {base}; estimated from CPU time, without idling",
        ),
        ("Gamma against N_go", _curve(tree), "dashed: gamma = N_go; line: Equation 3; dots: measured"),
    ]
    for mode in series:
        parts = {k: 1e-3 * net_mW * np.array(v) for k, v in series[mode]["cpu_ms"].items()}
        drawn.append(
            (
                f"{mode}: energy by stage",
                svg.areas(frames, parts, "frame", "mJ a frame"),
                "estimated from CPU time, without idling",
            )
        )
    for mode in others:
        lives = np.array(series[mode]["lives"], float)
        edges = np.linspace(0.5, max(lives.max(initial=1.0), 1.0) + 0.5, 31)
        counted = np.histogram(lives, edges)[0].astype(float)
        drawn.append((f"{mode}: life of tracks", svg.bars(edges, counted, "frames seen", "tracks"), "measured"))
    budget = [svg.Trace(mode, frames, np.array(series[mode]["classified"], float)) for mode in series]
    drawn.append(("Classifications a frame", svg.lines(budget, "frame", "classified"), "measured"))
    return drawn


def _curve(tree: dict[str, Any]) -> str:
    n = next(iter(tree["modes"].values()))["proposals"].value
    a = tree["unit_costs"]["a"].value
    life = np.geomspace(1.0, LONGEST, 100)
    short = life[life <= 10 * gamma(a, n, LONGEST)]
    traces = [
        svg.Trace("Equation 3 at this a and n", life, np.array([gamma(a, n, v) for v in life])),
        svg.Trace("gamma = N_go", short, short, dashed=True),
    ]
    for mode, saving in tree["savings"].items():
        point = np.array([tree["modes"][mode]["N_go"].value]), np.array([saving["gamma_measured_cpu"].value])
        traces.append(svg.Trace(mode, *point, dots=True))
    return svg.lines(traces, "N_go [frames]", "gamma", log=True)
