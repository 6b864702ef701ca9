"""A report as results, tables and notes, for a terminal; modt_desk.reporting.page shows the same as HTML."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from modt_desk.reporting.quantity import LEGEND, Quantity

Cell = str | Quantity
TERMS = (
    "E1, E2: energy of a frame, by tracking-by-detection (which classifies every proposal) and by modt",
    "gamma: E1 / E2, how many times less energy modt takes",
    "n, N_go: proposals a frame; frames in which a track has a proposal, on average",
    "a: energy of one classification over that of one segmentation",
    "beta: proposals classified over all proposals",
    "docs/energy.md derives gamma from n, N_go and a, and says what meters can tell",
)
"""Symbols of the reports, explained at their foot."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under a head, whose first cell is the title."""

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True, slots=True)
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
            lines += ["", *_aligned(table)]
        return "\n".join([*lines, "", *_wrapped(self.test), "", *(f"  {term}" for term in TERMS)])


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="    ")


def _aligned(table: Table) -> Iterator[str]:
    rows = [[c.marked() if isinstance(c, Quantity) else c for c in row] for row in (table.head, *table.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *others in rows:
        cells = (f"{cell:>{width}}" for cell, width in zip(others, widths[1:], strict=True))
        yield "  ".join([f"  {first:<{widths[0]}}", *cells])
