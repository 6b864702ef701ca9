"""A run's report as a page."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.energy.prediction import gamma
from modt.reporting import svg
from modt.reporting.compare_page import LONGEST, kinded
from modt.reporting.compare_text import conditions_text
from modt.reporting.page import page, plots, table, tiles


def run_page(tree: dict[str, Any]) -> str:
    """The page."""
    saved = tree["saved"]
    about = (
        f"{tree['frames']} frames, mode {tree['mode']}, field of view {tree['fov']}; meter: {tree['meter']['name']} "
        f"({tree['meter']['kind']}); {conditions_text(tree['conditions'])}"
        + ("" if tree["ended"] else "; still running or cut short")
    )
    answers = [
        ("energy a frame", kinded(tree["gross_J"], 1e3, "mJ"), f"{kinded(tree['net_J'], 1e3, 'mJ')} without idling"),
        ("power", kinded(tree["power_W"]), tree["test"]),
        ("gamma", kinded(saved["gamma_of_this_run"]), f"predicted {kinded(saved['gamma_predicted'])}"),
        ("beta", kinded(saved["beta"], 100, "%"), f"N_go {kinded(saved['N_go'])}"),
    ]
    return page(
        f"Energy of {tree['stream']}, {tree['mode']}",
        about,
        [tiles(answers), _where(tree), plots(_plots(tree)), _terms(tree), _ledger(tree)],
    )


def _where(tree: dict[str, Any]) -> str:
    rows = []
    for name in dict.fromkeys([*tree["parts_J"], *tree["cpu"]]):
        part, cpu = tree["parts_J"].get(name), tree["cpu"].get(name)
        rows.append(
            [
                name,
                kinded(part, 1e3, "mJ") if part else "-",
                *(kinded(cpu[key]) if cpu else "-" for key in ("cpu_ms", "wall_ms", "calls", "items", "points")),
            ]
        )
    return table(
        "Where it goes", ["", "energy a frame", "cpu", "wall", "calls", "items", "points"], rows, tree["test"]
    )


def _terms(tree: dict[str, Any]) -> str:
    saved = tree["saved"]
    rows = [["the short form, gamma = N_go", "", kinded(saved["gamma_short"])]]
    rows += [[t["name"], f"{t['change'].value:+.3f}", kinded(t["gamma"])] for t in saved["terms"]]
    note = "E1 is computed from this run's own costs; modt-profile compare measures it"
    return table("From N_go to gamma", ["reason", "change", "gamma"], rows, note)


def _ledger(tree: dict[str, Any]) -> str:
    rows = [[name, kinded(value)] for name, value in tree["ledger"].items()]
    marks = ", ".join(tree["marks"]) or "none"
    return table(
        "The instrument itself", ["", ""], rows, f"marks: {marks}; windows dropped: {tree['dropped_windows']}"
    )


def _plots(tree: dict[str, Any]) -> list[tuple[str, str, str]]:
    series = tree["series"]
    frames = np.arange(tree["frames"], dtype=float)
    parts = {stage: series["net_W"] * np.array(ms, float) for stage, ms in series["cpu_ms"].items()}
    e1 = series["net_W"] * np.array(series["predicted_cpu_ms"], float)
    e2 = np.sum([*parts.values()], axis=0)
    lives = np.array(series["lives"], float)
    edges = np.linspace(0.5, max(lives.max(initial=1.0), 1.0) + 0.5, 31)
    spent = [
        svg.Trace("classified", frames, np.array(series["classified"], float)),
        svg.Trace("deferred", frames, np.array(series["deferred"], float)),
    ]
    if series["budget"] is not None:
        spent.append(svg.Trace("budget", frames[[0, -1]], np.full(2, float(series["budget"])), dashed=True))
    cumulative = [
        svg.Trace("E1, tracking-by-detection (computed)", frames, 1e-3 * np.cumsum(e1), dashed=True),
        svg.Trace("E2, this run", frames, 1e-3 * np.cumsum(e2)),
    ]
    histogram = np.histogram(lives, edges)[0].astype(float)
    return [
        (
            "Energy by stage",
            svg.areas(frames, parts, "frame", "mJ a frame"),
            "estimated from CPU time, without idling",
        ),
        ("Cumulative energy, E1 against E2", svg.lines(cumulative, "frame", "J"), "estimated"),
        ("Gamma against N_go", _curve(tree), "dashed: gamma = N_go; line: Equation 3; dot: this run"),
        ("Life of tracks", svg.bars(edges, histogram, "frames seen", "tracks"), "measured"),
        ("Use of the budget", svg.lines(spent, "frame", "proposals"), "measured"),
    ]


def _curve(tree: dict[str, Any]) -> str:
    saved = tree["saved"]
    n, a = saved["proposals"].value, saved["a"].value
    if a is None:
        return svg.lines([], "N_go [frames]", "gamma")
    life = np.geomspace(1.0, LONGEST, 100)
    short = life[life <= 10 * gamma(a, n, LONGEST)]
    own = np.array([saved["N_go"].value]), np.array([saved["gamma_of_this_run"].value])
    traces = [
        svg.Trace("Equation 3 at this a and n", life, np.array([gamma(a, n, v) for v in life])),
        svg.Trace("gamma = N_go", short, short, dashed=True),
        svg.Trace(tree["mode"], *own, dots=True),
    ]
    return svg.lines(traces, "N_go [frames]", "gamma", log=True)
