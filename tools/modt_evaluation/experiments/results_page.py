"""All results on one page: the paper's figures drawn beside what it states, and the tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from modt.viewer.theme import COLOURS, LIGHT
from modt_evaluation.experiments import paper
from modt_evaluation.experiments.catalogue import DETECTION, Experiment
from modt_evaluation.experiments.markdown import ABOUT, CURVES, reading, table, tabulated
from modt_evaluation.experiments.study import Row
from modt_profiling.reporting.document import Page, Plot, Section, Table

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

MOST_LINES = 6
"""Greatest number of lines of a chart."""


def results_page(command: str, sources: str, experiments: Sequence[Experiment], rows: Sequence[Row]) -> Page:
    """A section for each experiment."""
    sections = [Section(lines=[f"{ABOUT}:"], preformatted=command), Section(lines=[f"{sources}. {reading(rows)}"])]
    for experiment in experiments:
        made = [row for row in rows if row.experiment == experiment.name]
        plots = [*_plots(experiment, made)] if experiment.swept else []
        listed = tabulated(experiment, made)
        tables = []
        if listed:
            head, *lines = table(experiment, listed)
            tables.append(Table(head, lines))
        notes = [experiment.note.replace("`", "")] if experiment.note else []
        sections.append(Section(experiment.title, notes, plots=plots, tables=tables))
    return Page("Results", "Li and Guivant's experiments", sections)


def _plots(experiment: Experiment, rows: Sequence[Row]) -> Iterator[Plot]:
    """A chart of each quantity: all streams in one, or one of each where variants are compared."""
    compared = len({row.variant for row in rows}) > 1
    several_profiles = len({row.profile for row in rows}) > 1
    for quantity in dict.fromkeys(row.quantity for row in rows):
        of_quantity = [row for row in rows if row.quantity == quantity]
        panels = dict.fromkeys(row.streams for row in of_quantity) if compared else [""]
        for streams in panels:
            lines: dict[str, list[Row]] = {}
            for row in of_quantity:
                if not compared or row.streams == streams:
                    name = row.variant if compared else row.streams
                    name += f", {row.profile}" if several_profiles else ""
                    lines.setdefault(name, []).append(row)
            title = f"{quantity}, {streams}" if streams else quantity
            yield _plot(experiment, title, quantity, lines)


def _plot(experiment: Experiment, title: str, quantity: str, lines: dict[str, list[Row]]) -> Plot:
    """The lines of a chart, those without a swept value as levels, and what the paper states."""
    marks = [*paper.marks(experiment.name, quantity)]
    drawn = dict([*lines.items()][:MOST_LINES])
    notes = [mark.words for mark in marks if mark.at is None and mark.value is None]
    if len(drawn) < len(lines):
        notes.append(f"{len(lines) - len(drawn)} further streams are in the table")

    def draw(axes: Axes) -> None:
        for (name, rows), colour in zip(drawn.items(), COLOURS, strict=False):
            known = [(row.at, row.value) for row in rows if row.value is not None]
            swept = [(at, value) for at, value in known if at is not None]
            if swept:
                axes.plot(*zip(*swept, strict=True), color=colour, label=name)
            for level in (value for at, value in known if at is None):
                axes.axhline(level, color=colour, linestyle="--", label=name)
        _draw_marks(axes, marks)
        axes.set(xlabel=experiment.swept, ylabel=quantity)
        if quantity.startswith(CURVES):
            axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.02))

    return Plot(title, ". ".join(notes), draw)


def _draw_marks(axes: Axes, marks: Sequence[paper.Mark]) -> None:
    """Crosses at places, dotted lines for levels and for best places."""
    soft = LIGHT["soft"]
    crosses: dict[str, list[tuple[float, float]]] = {}
    for mark in marks:
        if mark.at is not None and mark.value is not None:
            crosses.setdefault(mark.words, []).append((mark.at, mark.value))
        elif mark.value is not None:
            axes.axhline(mark.value, color=soft, linestyle="-." if DETECTION in mark.words else ":", label=mark.words)
        elif mark.at is not None:
            axes.axvline(mark.at, color=soft, linestyle=":", label=mark.words)
    for words, places in crosses.items():
        axes.plot(*zip(*places, strict=True), "x", color=soft, label=words)
