"""Gamma over several comparisons for people: how far off was what was said of it, tables and plots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from modt.types import Float64
from modt_desk.comparison.regimes import BLIND, FORMULAS
from modt_desk.reporting import svg
from modt_desk.reporting.document import Cell, Document, Table
from modt_desk.reporting.page import Plot
from modt_desk.reporting.quantity import Quantity, quantity

_ABOUT = (
    "gamma = N_go and Equation 3 take the counts and costs of the runs themselves; a blind prediction "
    "(modt-profile compare --against) had seen none of the modes run."
)
_NOTE = "a dot a comparison, with its interval at 95 %; dashed: "
Rows = Sequence[dict[str, Any]]


def regimes_document(tree: dict[str, Any]) -> Document:
    """Gamma by mode, how far off was what was said of it, and all figures."""
    modes = _by_mode(tree)
    results = [(f"{mode}: gamma, median", *_middle(rows)) for mode, rows in modes.items()]
    about = ["share: of classification in E1, the energy of tracking-by-detection"]
    return Document(
        "Gamma over regimes", about, results, [_table(mode, rows) for mode, rows in modes.items()], _ABOUT
    )


def regimes_plots(tree: dict[str, Any]) -> list[Plot]:
    """Gamma against what sets it; what was said of gamma against what was measured, a plot a mode."""
    modes = _by_mode(tree)
    return [_share_plot(modes), *(_said_plot(mode, rows) for mode, rows in modes.items())]


def _by_mode(tree: dict[str, Any]) -> dict[str, Rows]:
    """Regimes in the order of their gamma."""
    rows = sorted(tree["regimes"], key=lambda row: float(row["gamma"].value))
    modes = dict.fromkeys(row["mode"] for row in tree["regimes"])
    return {mode: [row for row in rows if row["mode"] == mode] for mode in modes}


def _said(rows: Rows) -> Iterator[tuple[str, Rows, list[Quantity]]]:
    """What was said of gamma, and of which regimes."""
    for name in (*FORMULAS, BLIND):
        known = [row for row in rows if name in row["said"]]
        if known:
            yield name, known, [row["said"][name] for row in known]


def _middle(rows: Rows) -> tuple[Quantity, str]:
    gamma, errors = _values(_gammas(rows)), []
    for name, known, said in _said(rows):
        off = np.abs(_values(said) / _values(_gammas(known)) - 1.0)
        errors.append(f"{name} {100 * np.median(off):.0f} %")
    note = f"{len(rows)} comparisons, {gamma.min():.2f} to {gamma.max():.2f}; median error: {', '.join(errors)}"
    return quantity(float(np.median(gamma))), note


def _table(mode: str, rows: Rows) -> Table:
    return Table([mode, "share", "gamma", *FORMULAS, BLIND], [_cells(row) for row in rows])


def _cells(row: dict[str, Any]) -> list[Cell]:
    said = row["said"]
    blind = said[BLIND].text() if BLIND in said else "-"
    return [
        row["name"],
        row["share"].scaled(100, "%"),
        row["gamma"].text(),
        *(said[name] for name in FORMULAS),
        blind,
    ]


def _share_plot(modes: dict[str, Rows]) -> Plot:
    drawn = [_dots(mode, rows, [row["share"] for row in rows], _gammas(rows)) for mode, rows in modes.items()]
    gamma = np.linspace(1.0, max(float(trace.all_y.max()) for trace in drawn), 100)
    free = svg.Trace("if classification cost nothing", 1.0 - 1.0 / gamma, gamma, dashed=True)
    picture = svg.lines([free, *drawn], "share of classification in E1", "gamma")
    return ("Gamma against the share of classification", picture, f"{_NOTE}if classification cost nothing")


def _said_plot(mode: str, rows: Rows) -> Plot:
    measured = _dots("measured", rows, _gammas(rows), _gammas(rows))
    said = [_dots(name, known, _gammas(known), quantities) for name, known, quantities in _said(rows)]
    ends = measured.x[[0, -1]]
    right = svg.Trace("", ends, ends, dashed=True, colour="var(--soft)")
    picture = svg.lines([measured, *said, right], "gamma measured", "gamma said", log=True)
    return (f"{mode}: gamma said against measured", picture, f"{_NOTE}as measured")


def _dots(name: str, rows: Rows, x: Sequence[Quantity], y: Sequence[Quantity]) -> svg.Trace:
    names = [f"{name}, {row['name']}" for row in rows]
    return svg.Trace(name, _values(x), _values(y), dots=True, names=names, span=_spans(y))


def _gammas(rows: Rows) -> list[Quantity]:
    return [row["gamma"] for row in rows]


def _values(quantities: Sequence[Quantity]) -> Float64:
    return np.array([q.value for q in quantities], float)


def _spans(quantities: Sequence[Quantity]) -> Float64:
    """(n, 2) intervals; of a quantity without one its value."""
    return np.array([(q.value, q.value) if q.low is None else (q.low, q.high) for q in quantities], float)
