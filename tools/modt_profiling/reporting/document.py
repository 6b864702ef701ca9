"""A report as results, tables and plots, for a terminal or as a self-contained HTML page.

Plots are functions that draw on axes of Matplotlib. The text of a report needs no Matplotlib.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from modt_profiling.reporting.quantity import LEGEND, Quantity, aligned

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Link:
    """Text that leads to another file on a page."""

    text: str
    place: str  # relative to the page

    def marked(self) -> str:
        """The text, as a terminal shows it."""
        return self.text


Cell = str | Quantity | Link
TERMS = (
    "E1, E2: energy of a frame, by tracking-by-detection (which classifies every proposal) and by modt",
    "gamma: E1 / E2, how many times less energy modt takes",
    "n, N_go: proposals a frame; frames in which a track has a proposal, on average",
    "a: energy of one classification over that of one segmentation",
    "beta: proposals classified over all proposals",
    "docs/energy.md derives gamma from n, N_go and a, and says what meters can tell",
)
"""Symbols of the reports, explained at their foot."""
CHART_IN = (3.6, 2.3)
"""Width and height of a chart [inch]; a page stretches it to the width that it has."""


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head, whose first cell is the title."""

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True)
class Plot:
    """A drawing on axes of its own, with a title and a note."""

    title: str
    note: str
    draw: Callable[[Axes], object]
    size_in: tuple[float, float] = CHART_IN


@dataclass(frozen=True)
class Section:
    """Part of a page; its contents stand in this order."""

    title: str = ""
    lines: Sequence[str] = ()
    tiles: Sequence[tuple[str, Cell, str]] = ()  # name, value and note of facts that stand side by side
    plots: Sequence[Plot] = ()  # charts side by side, as wide as the page allows
    pictures: Sequence[Plot] = ()  # drawings in their own size
    tables: Sequence[Table] = ()
    preformatted: str = ""  # text whose lines and columns stay as they are


@dataclass(frozen=True)
class Page:
    """Contents of a page."""

    title: str
    about: str
    sections: Sequence[Section]


@dataclass(frozen=True)
class Document:
    """A report."""

    title: str
    about: Sequence[str]  # sentences on the run, the meter and its conditions
    results: Sequence[tuple[str, Quantity, str]]  # name, value, note
    tables: Sequence[Table]
    test: str  # claim that the figures test

    def text(self) -> str:
        """Lines of 100 columns at most, results first."""
        lines = [self.title, *_wrapped(LEGEND), ""]
        for name, value, note in self.results:
            lines += _wrapped(f"{name}: {value.text()}; {note}")
        lines += ["", *(f"  {fact}" for fact in self.about)]
        for table in self.tables:
            rows = [[c if isinstance(c, str) else c.marked() for c in row] for row in (table.head, *table.rows)]
            lines += ["", *aligned(rows)]
        return "\n".join([*lines, "", *_wrapped(self.test), "", *(f"  {term}" for term in TERMS)])

    def page(self, plots: Sequence[Plot]) -> Page:
        """The report with its plots."""
        results = Section(tiles=self.results, plots=plots)
        tables = Section("Tables", lines=[LEGEND], tables=self.tables)
        notes = Section("Terms", lines=[self.test, *TERMS])
        return Page(self.title, "; ".join(self.about), [results, tables, notes])


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="    ")
