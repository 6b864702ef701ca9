"""Report over all runs of a dataset: figures with intervals over the recordings, and the worst runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from modt.energy.meters.meter import Kind
from modt_batch.dataset import PAGES
from modt_profiling.reporting.document import Document, Link, Table
from modt_profiling.reporting.quantity import Quantity, estimate, quantity

Row = Mapping[str, Any]
CONVENTIONAL = "conventional"
MODELLED = "Energy is assumed power times CPU time: this tests the counting, not the physics."
WORST = "worst: the fewest trusted frames first, then the longest frames"


@dataclass(frozen=True)
class Figure:
    """A column of the table of runs, as it is shown."""

    title: str
    column: str
    unit: str = ""
    kind: Kind = Kind.MEASURED


FIGURES = (
    Figure("objects tracked in a recording", "objects"),
    Figure("N_go of objects", "N_go_objects", "frames"),
    Figure("N_go", "N_go", "frames"),
    Figure("beta", "beta"),
    Figure("frames whose result is trusted", "trusted", "%"),
    Figure("CPU time of a frame", "cpu_ms", "ms"),
    Figure("CPU time of 99 % of the frames", "cpu_ms_p99", "ms"),
    Figure("energy of a frame", "pipeline_mJ", "mJ", Kind.ESTIMATED),
)


def document(runs: Sequence[Row], failures: Sequence[tuple[str, str]], worst: Sequence[Row]) -> Document:
    """The report on runs, the rows of the table `runs` of a dataset.

    Args:
        runs: all runs.
        failures: names of runs that failed, with the reason.
        worst: runs to list, which have a page.
    """
    rows = [dict(row, trusted=trusted_percent(row)) for row in runs]
    modes = sorted({row["mode"] for row in rows})
    by_mode = {mode: [row for row in rows if row["mode"] == mode] for mode in modes}
    recordings = len({row["recording"] for row in rows})
    total_J = sum(row["energy_J"] for row in rows)
    counts = f"{recordings} recordings, {len(runs)} runs, {sum(row['frames'] for row in rows)} frames"
    tables = [_figures(by_mode), Table(("worst runs", *WORST_COLUMNS), [_worst_row(row) for row in worst])]
    if failures:
        tables.append(Table(("failed runs", "reason"), failures))
    return Document(
        title=f"Batch of {recordings} recordings",
        about=[counts, WORST, "energy without idling; that of a frame without reading and writing"],
        results=[
            *_gammas(by_mode),
            ("energy of all runs", estimate(total_J, "J"), f"in {', '.join(modes)}, with reading and writing"),
            ("failed", quantity(len(failures)), "runs without a result; the same command tries them again"),
        ],
        tables=tables,
        test=MODELLED,
    )


def worst_first(runs: Sequence[Row]) -> list[Row]:
    """The runs: those with the smallest share of trusted frames first, then those with the longest frames."""
    return sorted(runs, key=lambda row: (trusted_percent(row), -(row["cpu_ms_p99"] or 0.0), row["run"]))


def trusted_percent(row: Row) -> float:
    """Share of the frames whose result is trusted [%]; frames that could not be read count as not trusted."""
    return float(100.0 * row["frames_good"] / max(row["frames"] + row["left_out"], 1))


def mean(values: Sequence[float | None], unit: str = "", kind: Kind = Kind.MEASURED) -> Quantity:
    """Mean over recordings, with its 95 % interval by Student's distribution where there are two or more.

    No figure is below 0 or above 100 %, so the interval ends there.
    """
    known = np.array([value for value in values if value is not None and np.isfinite(value)], float)
    if len(known) < 2:
        return quantity(float(known[0]) if len(known) else None, unit, kind)
    middle = float(known.mean())
    half = float(stdtrit(len(known) - 1, 0.975) * known.std(ddof=1) / np.sqrt(len(known)))
    most = 100.0 if unit == "%" else np.inf
    return quantity(middle, unit, kind, (max(middle - half, 0.0), min(middle + half, most)))


def _figures(by_mode: Mapping[str, Sequence[Row]]) -> Table:
    rows = []
    for figure in FIGURES:
        means = [mean([row[figure.column] for row in runs], figure.unit, figure.kind) for runs in by_mode.values()]
        rows.append((figure.title, *(found.text() for found in means)))
    return Table(("mean of the recordings", *by_mode), rows)


def _gammas(by_mode: Mapping[str, Sequence[Row]]) -> Iterator[tuple[str, Quantity, str]]:
    """How much less energy each mode takes than mode conventional, recording by recording."""
    before = {row["recording"]: row["pipeline_mJ"] for row in by_mode.get(CONVENTIONAL, ())}
    for mode, rows in by_mode.items():
        both = [row for row in rows if row["recording"] in before]
        if mode != CONVENTIONAL and both:
            ratios = [before[row["recording"]] / row["pipeline_mJ"] for row in both]
            yield f"gamma, {mode}", mean(ratios, kind=Kind.ESTIMATED), f"mean of {len(both)} recordings"


WORST_COLUMNS = ("trusted", "frames", "left out", "objects", "CPU time of 99 %", "energy of a frame")


def _worst_row(row: Row) -> tuple[str | Quantity | Link, ...]:
    return (
        Link(row["run"], f"{PAGES}/{row['run']}.html"),
        f"{trusted_percent(row):.1f} %",
        f"{row['frames']}",
        f"{row['left_out']}",
        f"{row['objects']}",
        quantity(row["cpu_ms_p99"], "ms").number(),
        estimate(row["pipeline_mJ"], "mJ").marked(),
    )
