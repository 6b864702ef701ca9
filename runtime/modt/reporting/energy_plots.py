"""Plots, tables and sentences that the reports of a run and of a comparison share."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.energy.prediction import EnergyModel
from modt.reporting import svg
from modt.reporting.document import Table
from modt.reporting.page import Plot
from modt.reporting.quantity import Quantity
from modt.types import Float64

_MAX_LIFE = 1000.0
"""Upper end of the N_go axis of the predicted curve [frames]."""


def stage_energy_mJ(series: dict[str, Any], net_W: float) -> dict[str, Float64]:
    """(frames,) energy of each stage above idling [mJ] by its CPU time."""
    return {stage: net_W * np.array(cpu_ms, float) for stage, cpu_ms in series["cpu_ms"].items()}


def stage_energy(title: str, energy_mJ: dict[str, Float64]) -> Plot:
    """Stacked energy of the stages over frames."""
    frames = np.arange(len(next(iter(energy_mJ.values()))), dtype=float)
    note = "estimated from CPU time, without idling"
    return (title, svg.areas(frames, energy_mJ, "frame", "mJ a frame"), note)


def cumulative_energy(energy_mJ: dict[str, Float64], note: str, dashed: str = "") -> Plot:
    """Energy summed over frames, a line a run; the one named is dashed."""
    traces = [
        svg.Trace(name, np.arange(len(mJ), dtype=float), 1e-3 * np.cumsum(mJ), dashed=name == dashed)
        for name, mJ in energy_mJ.items()
    ]
    return ("Cumulative energy, E1 against E2", svg.lines(traces, "frame", "J"), note)


def life_histogram(title: str, lives: list[int]) -> Plot:
    """Histogram of the lives of tracks [frames]."""
    life = np.array(lives, float)
    edges = np.linspace(0.5, max(life.max(initial=1.0), 1.0) + 0.5, 31)
    heights = np.histogram(life, edges)[0].astype(float)
    return (title, svg.bars(edges, heights, "frames seen", "tracks"), "measured")


def gamma_curve(a: Quantity, n: Quantity, runs: dict[str, tuple[Quantity, Quantity]], note: str) -> Plot:
    """Equation 3 over N_go at a and n, the short form, and (N_go, gamma) of each run."""
    traces = []
    if a.value is not None and n.value is not None:
        life = np.geomspace(1.0, _MAX_LIFE, 100)
        curve = np.array([EnergyModel(1.0, a.value, n.value, n_go).gamma for n_go in life.tolist()])
        short = life[life <= 10 * curve[-1]]
        traces = [
            svg.Trace("Equation 3 at this a and n", life, curve),
            svg.Trace("gamma = N_go", short, short, dashed=True),
        ]
        traces += [
            svg.Trace(name, np.array([x.value], float), np.array([y.value], float), dots=True)
            for name, (x, y) in runs.items()
        ]
    note = f"dashed: gamma = N_go; line: Equation 3; {note}"
    return ("Gamma against N_go", svg.lines(traces, "N_go [frames]", "gamma", log=True), note)


def gamma_terms(title: str, saving: dict[str, Any]) -> Table:
    """Table of the terms from gamma = N_go to the ratio of the runs."""
    short = ["the short form, gamma = N_go", "", saving["gamma_short"]]
    rows = [[term["name"], f"~{term['change'].value:+.3f}", term["gamma"]] for term in saving["terms"]]
    return Table([title, "change", "gamma"], [short, *rows])


def conditions_text(conditions: dict[str, Any]) -> str:
    """Governor, frequency and core, where available."""
    governor, frequency = conditions.get("governor"), conditions.get("frequency_MHz")
    return (
        f"governor {governor or 'unavailable'}, "
        f"frequency {'unavailable' if frequency is None else f'{frequency:.0f} MHz'}, core {conditions.get('core')}"
    )
