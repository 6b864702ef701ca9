"""The report of one run, from its directory alone: a tree of quantities, its text and plots.

The run may still be going on.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modt.classification.call_cost import padded_size
from modt.config import ClassificationConfig, EnergyConfig
from modt.energy.ledger import LedgerLine
from modt.energy.meters.meter import Kind
from modt.errors import MisuseError
from modt.pipeline import CLASSIFICATION, SEGMENTATION, SINK, SOURCE, STAGES
from modt.sinks.run_directory import LEDGER, SUMMARY, TRACKS
from modt.sinks.tracks import SCHEMA as FRAME_SCHEMA
from modt.types import Float64
from modt_profiling.energy.board_fit import nonnegative_fit
from modt_profiling.energy.run_energy import EnergySums, run_energy
from modt_profiling.energy.savings import OtherCosts, UnitCosts, reconcile
from modt_profiling.reporting import energy_plots
from modt_profiling.reporting.document import Cell, Document, Plot, Table
from modt_profiling.reporting.energy_plots import CLASS, SCHEDULE, SEG, TRACK, reconciliation_tree
from modt_profiling.reporting.quantity import Quantity, estimate, quantity
from modt_profiling.reporting.records import read_ledger, read_records, read_windows
from modt_profiling.reporting.run_sums import COLUMNS, FrameSums, run_facts

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

SCHEMA = "modt.report/2"
_CONVENTIONAL = "conventional"
_LIMITS = ("max_points", "likelihood")
_APART = (SOURCE, SINK, "idle", "unattributed")
"""Parts of the energy that are not the pipeline's."""
_BOARD = ("board", "idle_W", "busy_W", "seg_J", "class_J", "point_J")


def run_tree(run: Path) -> dict[str, Any]:
    """Report of a run directory; its records are read line by line, and none is kept.

    Raises:
        MisuseError: not a run directory, or without a complete frame so far.
    """
    facts = run_facts(run)
    limits = facts["profile"]["classification"]
    mode = facts["mode"]
    board = EnergyConfig(**{key: facts["profile"]["energy"][key] for key in _BOARD})
    sums = FrameSums(padded_size(ClassificationConfig(**{key: limits[key] for key in _LIMITS})))
    for line, record in zip(_frames(run), read_records(run / TRACKS, FRAME_SCHEMA), strict=False):
        sums.add(line, record)
    sums.finish()
    if not sums.series.count:
        raise MisuseError(run, "no whole frame is recorded", "wait for the first, or give another run")
    used = run_energy(read_windows(run / LEDGER), islice(_frames(run), sums.series.count), board)
    saved, e1_s = _saved(mode, sums, used)
    return {
        "schema": SCHEMA,
        "run": str(run),
        "stream": facts["stream"]["name"],
        "mode": mode,
        "fov": facts["fov"],
        "frames": sums.series.count,
        "ended": (run / SUMMARY).is_file(),
        "left_out": _summary(run).get("left_out", {}),
        "board": board.board,
        "conditions": {**used.conditions, "core": facts.get("core")},
        "test": (
            "Energy is assumed power times CPU time: this tests the counting, not the physics."
            if used.kind is Kind.ESTIMATED
            else "Energy is the meter's; its split over the stages is estimated."
        ),
        **_energy(used, board.idle_W),
        "dropped_windows": used.dropped,
        "cpu": _times(sums),
        "ledger": _ledger(sums),
        "saved": saved,
        "marks": sorted(sums.marks | used.marks),
        "series": _series(sums, e1_s)
        | {
            "stage_W": used.stage_watts(STAGES),
            "budget": None if mode == _CONVENTIONAL else facts["profile"]["scheduler"]["calls_per_frame"],
        },
    }


def _frames(run: Path) -> Iterator[LedgerLine]:
    return read_ledger(run / LEDGER)


def _energy(sums: EnergySums, idle_W: float) -> dict[str, Any]:
    """Energy a frame [J] and power [W], and their distribution."""
    frames = sums.frames
    seconds = 1e-9 * sums.wall_ns
    gross_J = sums.gross_J
    error_J = 1.96 * float(np.sqrt(sums.error2_J2))
    bounds = ((gross_J - error_J) / frames, (gross_J + error_J) / frames)
    return {
        "meter": {"name": sums.meter, "kind": sums.kind.value, "windows": sums.count},
        "gross_J": quantity(gross_J / frames, "J", sums.kind, bounds),
        "net_J": estimate((gross_J - idle_W * seconds) / frames, "J"),
        "pipeline_J": estimate(sum(sums.parts_J.get(stage, 0.0) for stage in STAGES) / frames, "J"),
        "power_W": quantity(gross_J / seconds if seconds else None, "W", sums.kind),
        "parts_J": {name: estimate(part_J / frames, "J") for name, part_J in sums.parts_J.items()},
    }


def _times(sums: FrameSums) -> dict[str, Any]:
    frames = sums.series.count
    return {
        stage: {
            "cpu_ms": quantity(1e-6 * work.cpu_ns / frames, "ms"),
            "wall_ms": quantity(1e-6 * work.wall_ns / frames, "ms"),
            "calls": quantity(work.calls),
            "items": quantity(work.items),
            "points": quantity(work.points),
        }
        for stage, work in sums.stages.items()
    }


def _ledger(sums: FrameSums) -> dict[str, Any]:
    return {
        "overhead_us": quantity(1e-3 * sums.overhead_ns / sums.series.count, "us"),
        "overhead_share": quantity(sums.overhead_ns / sums.cpu_ns if sums.cpu_ns else None),
    }


def _series(sums: FrameSums, e1_s: Float64) -> dict[str, Any]:
    """Means over the frames of each point, and the lengths of the tracks."""
    measured = ("cpu_ms", "classified", "deferred", "proposals", "lives")
    column = dict(zip(COLUMNS, sums.series.means.T, strict=True))
    return {
        "kinds": dict.fromkeys(measured, Kind.MEASURED.value)
        | dict.fromkeys(("stage_W", "e1_cpu_ms"), Kind.ESTIMATED.value),
        "frames": sums.series.frames.tolist(),
        "cpu_ms": {stage: (1e3 * column[stage]).round(4).tolist() for stage in STAGES},
        "e1_cpu_ms": (1e3 * e1_s).round(4).tolist(),
        **{name: column[name].tolist() for name in ("classified", "deferred", "proposals")},
        "lives": sums.lengths.occurrences(),
    }


def _saved(mode: str, sums: FrameSums, energy: EnergySums) -> tuple[dict[str, Any], Float64]:
    """Gamma by Equation 3 and in full from this run's own counts and costs; (points,) CPU seconds of E1."""
    run = sums.counts()
    cost = sums.series.total[: len(STAGES)] / run.frames
    load_s = nonnegative_fit(sums.load_gram, sums.load_moment).tolist()
    costs = UnitCosts(float(cost[SEG]), float(cost[TRACK].sum()), *load_s)
    other = OtherCosts(costs.track, float(cost[SCHEDULE].sum()))
    every = replace(
        run,
        classified_tracks=run.tracks,
        classified=run.proposals,
        points=int(sums.column("all_points")),
        calls=run.frames,
    )
    found = reconcile(every, run, costs, other, other)
    series = sums.series.means
    run_s = series[:, : len(STAGES)].sum(axis=1)
    e1_s = run_s
    if mode != _CONVENTIONAL:
        n, points = (series[:, COLUMNS.index(name)] for name in ("proposals", "all_points"))
        e1_s = run_s - series[:, CLASS] + costs.class_call + costs.class_item * n + costs.class_point * points
    class_W = energy.watts(CLASSIFICATION)
    e1, e2 = (float(seconds @ sums.series.frames) / run.frames for seconds in (e1_s, run_s))
    gamma = e1 / e2 if e2 else None
    return {
        "proposals": quantity(run.n),
        "N_obj": quantity(run.n_obj),
        "beta": quantity(run.beta),
        "N_go": quantity(run.n_go, "frames"),
        "views": quantity(run.classified / run.tracks if run.tracks else None),
        "E_seg": estimate(energy.watts(SEGMENTATION) * costs.seg, "J"),
        "E_class": estimate(class_W * costs.e_class(every), "J"),
        **reconciliation_tree(found, gamma),
        "gamma_of_this_run": estimate(gamma),
        "saved_J": estimate(class_W * (e1 - e2), "J"),
    }, e1_s


def run_document(tree: dict[str, Any]) -> Document:
    """Energy a frame and power, their distribution, the energy saved, and what gamma is made of."""
    saved = tree["saved"]
    meter = tree["meter"]
    ledger = tree["ledger"]
    of_e1 = "E1 is computed from this run's own costs; modt-profile compare runs the baseline"
    if tree["mode"] == "conventional":
        of_e1 = "this is tracking-by-detection itself: nothing was saved; run the other modes, or compare"
    marked = {key: value.marked() for key, value in saved.items() if isinstance(value, Quantity)}
    apart = [
        f"{name} {tree['parts_J'][name].scaled(1e3, 'mJ').marked()}" for name in _APART if name in tree["parts_J"]
    ]
    gross = f"with {', '.join(apart)}; power {tree['power_W'].marked()}"
    computed = (
        f"computed from this run: {marked['gamma_reconciled']} in full, {marked['gamma_equation_3']} by Equation 3, "
        f"{marked['gamma_short']} by N_go alone; a = {marked['a']}"
    )
    counts = (
        f"{marked['proposals']} proposals a frame, N_go {marked['N_go']}, {marked['views']} classifications a track"
    )
    share = f"{ledger['overhead_share'].scaled(100, '%').marked()} of the CPU time"
    results = [
        (
            "energy of the pipeline a frame",
            tree["pipeline_J"].scaled(1e3, "mJ"),
            "without reading, writing and idling",
        ),
        ("energy of the process a frame", tree["gross_J"].scaled(1e3, "mJ"), gross),
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
    if any(tree["left_out"].values()):
        means = (f"{kind} {mean:.0f}" for kind, mean in tree["left_out"].items() if mean)
        about.append(f"points of a frame without a proposal: {', '.join(means).replace('_', ' ')}")
    if not tree["ended"]:
        about.append("still running or cut short")
    if tree["marks"]:
        about.append(f"marked: {', '.join(tree['marks'])}")
    tables = [_stages(tree), energy_plots.gamma_terms("from N_go to gamma", saved)]
    return Document(f"Energy of {tree['stream']}, {tree['mode']}", about, results, tables, tree["test"])


def _stages(tree: dict[str, Any]) -> Table:
    keys = {"cpu_ms": "CPU a frame", "wall_ms": "elapsed", "calls": "calls", "items": "items", "points": "points"}
    parts = tree["parts_J"]
    times = tree["cpu"]
    whole = sum(part.value or 0.0 for part in parts.values()) or 1.0
    rows: list[list[Cell]] = []
    for name in dict.fromkeys([*STAGES, *times, *parts]):
        energy: list[Cell] = ["-", "-"]
        if name in parts:
            energy = [parts[name].scaled(1e3, "mJ"), parts[name].scaled(100 / whole, "%")]
        work = {key: q for key, q in times.get(name, {}).items() if key != "points" or q.value}
        rows.append([name, *energy, *(work.get(key, "-") for key in keys)])
    return Table(["stage", "energy a frame", "share", *keys.values()], rows)


def run_plots(tree: dict[str, Any]) -> list[Plot]:
    """Plots over frames, over N_go and over the lengths of tracks."""
    series = tree["series"]
    saved = tree["saved"]
    each = np.array(series["frames"], float)
    frames = np.cumsum(each) - each
    parts_mJ = energy_plots.stage_energy_mJ(series)
    basis = energy_plots.basis(tree["gross_J"])
    note = f"E1: tracking-by-detection, estimated; E2: {basis}"
    baseline = "E1, computed"
    run_mJ = np.sum([*parts_mJ.values()], axis=0)
    run_ms = np.sum([*series["cpu_ms"].values()], axis=0)
    further_ms = np.array(series["e1_cpu_ms"]) - run_ms  # CPU time of the classifications that E1 adds
    energy_mJ = {baseline: run_mJ + series["stage_W"][CLASSIFICATION] * further_ms, "E2, this run": run_mJ}
    used = {name: series[name] for name in ("classified", "deferred")}
    point = {tree["mode"]: (saved["N_go"], saved["gamma_of_this_run"])}
    return [
        energy_plots.stage_energy("Energy by stage", parts_mJ, frames, basis),
        energy_plots.cumulative_energy(energy_mJ, each, note, dashed=baseline),
        energy_plots.gamma_curve(saved["a"], saved["proposals"], point, "dot: this run"),
        energy_plots.length_histogram("Lengths of tracks", series["lives"]),
        energy_plots.proposal_counts("Use of the budget", frames, used, series["budget"]),
    ]


def _summary(run: Path) -> dict[str, Any]:
    """Summary of a run that has ended, else nothing."""
    path = run / SUMMARY
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return found


def lateness_plots(run: Path) -> list[Plot]:
    """A plot from the summary of a service that has ended, none of another run."""
    late = _summary(run).get("lateness", {})
    if not late.get("frames"):
        return []
    ms = np.array(late["ms"], float)
    frames = np.array(late["frames"], float)

    def draw(axes: Axes) -> None:
        axes.loglog(ms, frames)
        axes.set(xlabel="from the arrival of the sweep [ms]", ylabel="frames as late or later")

    return [Plot("Lateness", "measured", draw)]
