"""Plots, tables, sentences and terms of gamma that the reports of a run and of a comparison share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from modt.energy.meters.meter import Kind
from modt.pipeline import CLASSIFICATION, FUSION, ODOMETRY, SCHEDULING, SEGMENTATION, STAGES, TRACKING
from modt.types import Float64
from modt_profiling.energy.savings import EnergyModel, Reconciliation
from modt_profiling.reporting.document import Plot, Table
from modt_profiling.reporting.quantity import Quantity, estimate

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

SEG = STAGES.index(SEGMENTATION)
CLASS = STAGES.index(CLASSIFICATION)
TRACK = [STAGES.index(ODOMETRY), STAGES.index(TRACKING)]
SCHEDULE = [STAGES.index(SCHEDULING), STAGES.index(FUSION)]


def reconciliation_tree(found: Reconciliation, gamma: float | None) -> dict[str, Any]:
    """The paper's figures, the reconciled gamma, and the terms from N_go to the gamma of the runs."""
    return {
        "a": estimate(found.paper.a),
        "gamma_short": estimate(found.paper.n_go),
        "gamma_equation_3": estimate(found.paper.gamma),
        "gamma_reconciled": estimate(found.model.gamma),
        "terms": [
            {"name": term.name, "change": estimate(term.change), "gamma": estimate(term.gamma)}
            for term in found.explain(1.0 if gamma is None else gamma)
        ],
    }


_MAX_BARS = 30
"""Greatest number of bars of a histogram."""
_MAX_N_GO = 1000.0
"""Upper end of the N_go axis of the curve of Equation 3 [frames]."""


def stage_energy_mJ(series: dict[str, Any]) -> dict[str, Float64]:
    """(frames,) energy attributed to each stage [mJ]: its power above idling times its CPU time."""
    return {stage: watts * np.array(series["cpu_ms"][stage], float) for stage, watts in series["stage_W"].items()}


def basis(gross_J: Quantity) -> str:
    """Origin of the energy that the plots show."""
    if gross_J.kind is Kind.ESTIMATED:
        return "estimated from CPU time, without idling"
    return f"{gross_J.kind}, its split over stages and frames estimated; without idling and what is unattributed"


def stage_energy(title: str, energy_mJ: dict[str, Float64], frames: Float64, note: str, top_mJ: float = 0.0) -> Plot:
    """Stacked energy of the stages over (points,) frames; charts to be compared have one `top_mJ`."""

    def draw(axes: Axes) -> None:
        if energy_mJ:
            axes.stackplot(frames, *energy_mJ.values(), labels=[*energy_mJ])
        axes.set(xlabel="frame", ylabel="mJ a frame", ylim=(0.0, 1.05 * top_mJ if top_mJ else None))

    return Plot(title, note, draw)


def cumulative_energy(energy_mJ: dict[str, Float64], each: Float64, note: str, dashed: str = "") -> Plot:
    """Energy a frame summed over points of so many frames each, a line a run; the one named is dashed."""

    def draw(axes: Axes) -> None:
        for name, mJ in energy_mJ.items():
            axes.plot(np.cumsum(each), 1e-3 * np.cumsum(each * mJ), "--" if name == dashed else "-", label=name)
        axes.set(xlabel="frame", ylabel="J", ylim=(0.0, None))

    return Plot("Cumulative energy, E1 against E2", note, draw)


def proposal_counts(title: str, frames: Float64, counts: dict[str, list[float]], budget: float | None = None) -> Plot:
    """Counts over (points,) frames, a line each, and a budget as a dashed level where there is one."""

    def draw(axes: Axes) -> None:
        for name, values in counts.items():
            axes.plot(frames, values, label=name)
        if budget is not None:
            axes.axhline(budget, linestyle="--", color="C2", label="budget")
        axes.set(xlabel="frame", ylabel="proposals", ylim=(0.0, None))

    return Plot(title, "counted", draw)


def length_histogram(title: str, lengths: dict[str, list[int]]) -> Plot:
    """Histogram of track lengths [frames], by the occurrences of each length."""
    longest = max([1, *lengths["values"]])
    width = math.ceil(longest / _MAX_BARS)  # frames, so that each bar counts as many lengths

    def draw(axes: Axes) -> None:
        axes.hist(lengths["values"], np.arange(0.5, longest + width, width), weights=lengths["counts"], rwidth=0.9)
        axes.set(xlabel="frames seen", ylabel="tracks", xlim=(0.0, longest + width))
        axes.locator_params(axis="x", integer=True)

    return Plot(title, "counted", draw)


def gamma_curve(a: Quantity, n: Quantity, runs: dict[str, tuple[Quantity, Quantity]], note: str) -> Plot:
    """Equation 3 over N_go at a and n, the short form, and (N_go, gamma) of each run."""
    length = np.geomspace(1.0, _MAX_N_GO, 100)

    def draw(axes: Axes) -> None:
        axes.set(xlabel="N_go [frames]", ylabel="gamma", xscale="log", yscale="log")
        if a.value is None or n.value is None:
            return
        curve = np.array([EnergyModel(1.0, a.value, n.value, n_go).gamma for n_go in length.tolist()])
        short = length[length <= 10 * curve[-1]]
        axes.plot(length, curve, label="Equation 3")
        axes.plot(short, short, "--", label="gamma = N_go")
        for name, (n_go, gamma) in runs.items():
            axes.plot(np.array([n_go.value], float), np.array([gamma.value], float), label=name)

    return Plot("Gamma against N_go", f"dashed: gamma = N_go; line: Equation 3 at this a and n; {note}", draw)


def gamma_terms(title: str, saving: dict[str, Any]) -> Table:
    """Table of the terms from gamma = N_go to the ratio of the runs, without those that change nothing."""
    short = ["the short form, gamma = N_go", "", saving["gamma_short"]]
    changes = [(term, f"{term['change'].value:+.3f}") for term in saving["terms"]]
    rows = [[term["name"], change, term["gamma"]] for term, change in changes if float(change)]
    return Table([title, "estimated change", "gamma"], [short, *rows])


def conditions_text(conditions: dict[str, Any]) -> str:
    """Governor, frequency and core, where available."""
    governor = conditions.get("governor")
    frequency = conditions.get("frequency_MHz")
    return (
        f"governor {governor or 'unavailable'}, "
        f"frequency {'unavailable' if frequency is None else f'{frequency:.0f} MHz'}, core {conditions.get('core')}"
    )
