"""All charts and tables on one page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from modt.reporting import page
from modt_desk.experiments.catalogue.experiment import Experiment
from modt_desk.experiments.output import charts
from modt_desk.experiments.output.about import About
from modt_desk.experiments.output.tables import Table, tables
from modt_desk.experiments.study import Row


def html(about: About, experiments: Sequence[Experiment], rows: Sequence[Row]) -> str:
    """A self-contained page."""
    blocks = [block for e in experiments for block in _blocks(e, [row for row in rows if row.experiment == e.name])]
    subtitle = f"{about.sources()}. In brackets, 95 % intervals over objects."
    return page.page("Results of the experiments", subtitle, blocks)


def _blocks(experiment: Experiment, rows: Sequence[Row]) -> Iterator[str]:
    if not rows:
        return
    yield f"<section><h2>{escape(experiment.title)}</h2><p>{escape(experiment.note)}</p>"
    for table in tables(experiment, rows, most=10**6):
        yield _table(table)
    yield "</section>"
    yield page.plots(
        (f"{chart.title}: {streams}", charts.picture(chart, drawn), experiment.title)
        for streams, chart, drawn in charts.drawings(experiment, rows)
    )


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in table.head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return f"<table><tr>{head}</tr>{body}</table>"
