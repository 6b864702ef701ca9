"""A comparison of the modes for people: results, tables and plots."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.energy.meters.meter import Kind
from modt_profiling.comparison.prediction_report import against_table
from modt_profiling.reporting import energy_plots
from modt_profiling.reporting.document import Document, Plot, Table

_UNITS = {
    "E_seg": "energy of one segmentation",
    "E_class": "energy of one classification",
    "E_track": "energy of tracking a frame",
    "seg_cpu_ms": "CPU time of one segmentation",
    "class_cpu_ms": "CPU time of one classification",
    "track_cpu_ms": "CPU time of tracking a frame",
    "class_call_cpu_us": "CPU time of a call of the network",
    "class_item_cpu_us": "further CPU time of each proposal in it",
    "class_point_cpu_us": "further CPU time of each point in it",
    "a": "a",
}
"""Names of the unit costs for people."""


def compare_document(tree: dict[str, Any]) -> Document:
    """The energy saved, whether the counts explain it, and the distribution of the energy."""
    meter = tree["meter"]
    results = []
    for mode, s in tree["savings"].items():
        energy = f"gamma {s['gamma_net'].marked()} without idling, {s['gamma_gross'].marked()} with idling"
        results += [
            (f"{mode}: gamma of CPU time", s["gamma_measured_cpu"], _verdict(s)),
            (f"{mode}: energy saved a frame", s["saved_J"].scaled(1e3, "mJ"), f"{energy}{_against_meter(s)}"),
        ]
    about = [
        f"{tree['frames']} frames, field of view {tree['fov']}, {tree['repeat']} repetitions, modes interleaved",
        f"meter: {meter['name']} ({meter['kind']})",
        energy_plots.conditions_text(tree["conditions"]),
    ]
    terms = [energy_plots.gamma_terms(f"{mode}: from N_go to gamma", s) for mode, s in tree["savings"].items()]
    blind = [against_table(tree["against"])] if "against" in tree else []
    units = [[_UNITS[key], cost] for key, cost in tree["unit_costs"].items()]
    costs = Table(["unit of work", "cost by the run of varied load"], units)
    return Document(
        f"Energy of {tree['stream']}", about, results, [*blind, _modes(tree), *terms, costs], tree["test"]
    )


def _modes(tree: dict[str, Any]) -> Table:
    modes = tree["modes"].values()
    stages = next(iter(modes))["stages"]
    rows = [
        ["energy of the pipeline", *(m["net_J"].scaled(1e3, "mJ") for m in modes)],
        [f"  with idling, {tree['basis']}", *(m["gross_J"].scaled(1e3, "mJ") for m in modes)],
        *([f"  of {stage}", *(m["stages"][stage]["energy_J"].scaled(1e3, "mJ") for m in modes)] for stage in stages),
        ["CPU time of the pipeline", *(m["cpu_ms"] for m in modes)],
        *([f"  of {stage}", *(m["stages"][stage]["cpu_ms"] for m in modes)] for stage in stages),
        ["proposals", *(m["proposals"] for m in modes)],
        ["classified", *(m["classified"] for m in modes)],
        ["beta", *(m["beta"].scaled(1e2, "%") for m in modes)],
        ["N_go", *(m["N_go"] for m in modes)],
        ["classifications a track", *(m["views"] for m in modes)],
    ]
    return Table(["a frame", *tree["modes"]], rows)


def _verdict(saving: dict[str, Any]) -> str:
    """Whether counts and unit costs explain the ratio, with the deviation and its interval."""
    deviation = saving["deviation"]
    short = saving["short_form_error"]
    closes = "closes within 5 %" if abs(deviation.value) <= 0.05 else "does NOT close within 5 %"
    interval = f"{100 * deviation.low:+.1f} to {100 * deviation.high:+.1f}"
    return (
        f"reconciled {saving['gamma_reconciled'].text()}; "
        f"the reconciliation {closes}: deviation {100 * deviation.value:+.1f} % ({interval}, over frames); "
        f"at a = {saving['a'].marked()} the error of gamma = N_go is {100 * short.value:+.0f} %"
    )


def _against_meter(saving: dict[str, Any]) -> str:
    deviation = saving["deviation_net"].value
    calibrated = saving["gamma_calibrated"]
    text = "" if calibrated.value is None else f"; gamma by calibrated joules is {calibrated.marked()}"
    if saving["gamma_gross"].kind is Kind.ESTIMATED or deviation is None:
        return text
    return f"{text}; deviation of the reconciliation {100 * deviation:+.1f} % against the meter"


def compare_plots(tree: dict[str, Any]) -> list[Plot]:
    """Plots over frames, over N_go and over track length."""
    series = tree["series"]
    modes = tree["modes"]
    base, *others = series
    basis = energy_plots.basis(modes[base]["gross_J"])
    energy_mJ = {mode: energy_plots.stage_energy_mJ(series[mode]) for mode in series}
    sums_mJ = {mode: np.sum([*parts.values()], axis=0) for mode, parts in energy_mJ.items()}
    top_mJ = max(float(sums.max(initial=0.0)) for sums in sums_mJ.values())
    points = {mode: (modes[mode]["N_go"], s["gamma_measured_cpu"]) for mode, s in tree["savings"].items()}
    frames = np.arange(tree["frames"], dtype=float)
    classified = {mode: series[mode]["classified"] for mode in series}
    return [
        energy_plots.cumulative_energy(sums_mJ, np.ones(len(frames)), f"E1: {base}; {basis}"),
        energy_plots.gamma_curve(tree["unit_costs"]["a"], modes[base]["proposals"], points, "dots: of CPU time"),
        *(
            energy_plots.stage_energy(f"{mode}: energy by stage", mJ, frames, basis, top_mJ)
            for mode, mJ in energy_mJ.items()
        ),
        *(energy_plots.length_histogram(f"{mode}: lengths of tracks", series[mode]["lives"]) for mode in others),
        energy_plots.proposal_counts("Classifications a frame", frames, classified),
    ]
