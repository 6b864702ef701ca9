"""The page that the documents hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from modt_desk.experiments import paper
from modt_desk.experiments.catalogue.experiment import Experiment
from modt_desk.experiments.drives import KITTI
from modt_desk.experiments.output.about import About
from modt_desk.experiments.output.shortfalls import shortfalls
from modt_desk.experiments.output.tables import Table, tables
from modt_desk.experiments.study import Row

MOST = 6
"""Values of a sweep in a table; the CSV files have all."""


def markdown(about: About, experiments: Sequence[Experiment], rows: Sequence[Row]) -> str:
    """Results in tables, streams that had no say in choices first."""
    return "\n".join([*_head(about, rows), *_body(experiments, rows)]) + "\n"


def _head(about: About, rows: Sequence[Row]) -> Iterator[str]:
    said = ", ".join(sorted({row.streams for row in rows if row.had_a_say})) or "none"
    yield from (
        "# Results",
        "",
        "The paper's tables and figures (its section VI), and what goes beyond them, as this command finds them:",
        "",
        f"    {about.command}",
        "",
        f"{about.sources()}. In brackets: the "
        "95 % interval of a bootstrap over objects (beta, false alarms: over tracks), not given of a single one; "
        "*paper*: what the paper states, over its eight drives where not of the drive itself. Simulated drives and "
        "KITTI's stand apart; streams that had no say in any choice of this project come first. "
        f"That had a say: {said}. "
        "Curves and whole sweeps are in the files that the command writes: JSON, CSV, SVG, and `index.html`.",
        "",
        *shortfalls(rows),
    )


def _body(experiments: Sequence[Experiment], rows: Sequence[Row]) -> Iterator[str]:
    for experiment in experiments:
        own = [row for row in rows if row.experiment == experiment.name]
        found = list(tables(experiment, own, MOST))
        if not found:
            continue
        yield from ("", f"## {experiment.title}", "", *([experiment.note, ""] if experiment.note else []))
        for table in found:
            yield from _lines(table)
        if experiment.name == "table3":
            there = {row.streams[:4] for row in own if row.kind == KITTI}
            yield ""
            yield from (f"- {drive}: {why}" for drive, why in paper.DEVIATIONS.items() if drive in there)


def _lines(table: Table) -> Iterator[str]:
    for row in (table.head, tuple("---" for _ in table.head), *table.rows):
        yield f"| {' | '.join(row)} |"
