"""A report as results, tables and notes, for a terminal or as a self-contained HTML page with plots.

The page is for light and dark screens and for print.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from modt.sinks.output import writing
from modt.viewer.theme import COLOURS, THEME
from modt_profiling.reporting.quantity import LEGEND, Quantity, aligned

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
            rows = [[c.marked() if isinstance(c, Quantity) else c for c in row] for row in (table.head, *table.rows)]
            lines += ["", *aligned(rows)]
        return "\n".join([*lines, "", *_wrapped(self.test), "", *(f"  {term}" for term in TERMS)])


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="    ")


_STYLE = """
*{box-sizing:border-box}
body{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);margin:0 auto;
max-width:1100px;padding:24px 20px;overflow-wrap:anywhere}
h1{font-size:1.6rem;margin:0}h2{font-size:1.1rem;margin:0 0 .5rem}
.sub{color:var(--soft);margin:.2rem 0 1.2rem}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(190px,1fr));gap:12px;margin:0 0 20px}
.tile{background:var(--panel);border:1px solid var(--line);border-radius:8px;padding:12px 14px;min-width:0}
.tile b{display:block;font-size:1.5rem;line-height:1.25;font-variant-numeric:tabular-nums}
.tile small{color:var(--soft)}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(440px,100%),1fr));gap:16px;margin:0 0 16px}
section{background:var(--panel);border:1px solid var(--line);border-radius:8px;padding:14px;margin:0 0 16px;
break-inside:avoid;overflow-x:auto}
.plots section{margin:0;min-width:0}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:4px 10px;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th:first-child,td:first-child{text-align:left;white-space:normal;min-width:7.5rem}
th{color:var(--soft);font-weight:600}
em{font-style:normal;color:var(--soft);font-size:.8em}.tile em{font-size:.8rem;font-weight:400}
svg{width:100%;height:auto;display:block}
svg text{font-size:11px;fill:var(--soft)}.end{text-anchor:end}.mid{text-anchor:middle}
.grid{stroke:var(--line)}.axis{stroke:var(--soft)}polyline{fill:none;stroke-width:2}
.legend{margin:.3rem 0 0;color:var(--soft);font-size:.85rem}
.legend span{margin-right:14px;white-space:nowrap}
.legend i{display:inline-block;width:10px;height:10px;border-radius:2px;margin-right:5px}
@media (max-width:600px){svg text{font-size:17px}}
@media print{:root{--ink:#000;--soft:#444;--line:#bbb;--paper:#fff;--panel:#fff}body{max-width:none;padding:0}
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}.plots{grid-template-columns:1fr 1fr}}
"""


Plot = tuple[str, str, str]
"""Title, SVG and note of a plot."""


def document_page(document: Document, drawn: Iterable[Plot]) -> str:
    """HTML of a report with its plots."""
    blocks = [
        tiles(document.results),
        plots(drawn),
        *map(_table, document.tables),
    ]
    notes = "".join(f'<p class="legend">{escape(note)}</p>' for note in (document.test, LEGEND, *TERMS))
    return page(document.title, "; ".join(document.about), [*blocks, notes])


def page(title: str, subtitle: str, blocks: Iterable[str]) -> str:
    """HTML of a page."""
    colours = "".join(
        f".l{k}{{stroke:{c}}}.c{k},.a{k}{{fill:{c}}}.b{k}{{background:{c}}}" for k, c in enumerate(COLOURS)
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{THEME}{_STYLE}{colours}</style></head><body>"
        f'<h1>{escape(title)}</h1><p class="sub">{escape(subtitle)}</p>{"".join(blocks)}</body></html>\n'
    )


def tiles(facts: Iterable[tuple[str, Cell, str]]) -> str:
    """Facts side by side: name, value and note of each."""
    cells = (
        f'<div class="tile"><small>{escape(name)}</small><b>{_cell(value)}</b><small>{escape(note)}</small></div>'
        for name, value, note in facts
    )
    return f'<div class="tiles">{"".join(cells)}</div>'


def plots(items: Iterable[Plot]) -> str:
    """Plots side by side."""
    cells = (
        f'<section><h2>{escape(title)}</h2>{svg}<p class="legend">{escape(note)}</p></section>'
        for title, svg, note in items
    )
    return f'<div class="plots">{"".join(cells)}</div>'


def preformatted(text: str) -> str:
    """Text whose lines and columns stay as they are."""
    return f"<section><pre>{escape(text)}</pre></section>"


def save(path: Path, text: str) -> None:
    """Write the page.

    Raises:
        ModtError: it cannot be written.
    """
    with writing(path):
        path.write_text(text, encoding="utf-8")


def _table(table: Table) -> str:
    title, *others = table.head
    top = "".join(f"<th>{escape(cell)}</th>" for cell in ("", *others))
    body = "".join("<tr>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return f"<section><h2>{escape(title)}</h2><table><tr>{top}</tr>{body}</table></section>"


def _cell(cell: Cell) -> str:
    """HTML of a cell; the kind of a quantity is small."""
    if isinstance(cell, str):
        return escape(cell)
    value, bracket, kind = cell.with_kind().partition(" (")
    return escape(value) + (f" <em>({escape(kind)}</em>" if bracket else "")
