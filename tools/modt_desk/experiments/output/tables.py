"""Rows of figures as tables: quantities or swept values across, streams and variants down."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from modt_desk.experiments.catalogue.experiment import Experiment
from modt_desk.experiments.study import Row

CURVE = "precision "
DISTANCE = "distance "
"""Beginnings of quantities that are drawn, not listed."""
NOT_THERE = "-"


@dataclass(frozen=True, slots=True)
class Table:
    """Cells under a head."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def tables(experiment: Experiment, rows: Sequence[Row], most: int) -> Iterator[Table]:
    """The figures of an experiment; of a sweep, at most so many values."""
    several = len({row.profile for row in rows}) > 1
    listed = [
        replace(row, variant=f"{row.variant}, profile {row.profile}") if several else row
        for row in rows
        if not row.quantity.startswith((CURVE, DISTANCE))
    ]
    if not listed:
        return
    swept = sorted({row.at for row in listed if row.at is not None})
    yield _over_sweep(experiment, listed, _spread(swept, most)) if swept else _by_variant(listed)


def _by_variant(rows: Sequence[Row]) -> Table:
    """Quantities across."""
    quantities = list(dict.fromkeys(row.quantity for row in rows))
    cell = {(row.streams, row.variant, row.quantity): _cell(row) for row in rows}
    lines = dict.fromkeys((row.streams, row.variant) for row in rows)
    body = ((*line, *(cell.get((*line, quantity), NOT_THERE) for quantity in quantities)) for line in lines)
    return Table(("streams", "variant", *quantities), tuple(body))


def _over_sweep(experiment: Experiment, rows: Sequence[Row], swept: Sequence[float]) -> Table:
    """Swept values across; first what is not swept."""
    cell = {(row.streams, row.variant, row.quantity, row.at): _cell(row) for row in rows}
    lines = dict.fromkeys((row.streams, row.variant, row.quantity) for row in rows)
    columns = [*([None] if any(row.at is None for row in rows) else []), *swept]
    body = ((*line, *(cell.get((*line, at), NOT_THERE) for at in columns)) for line in lines)
    over = experiment.charts[0].x_label
    names = ("not swept" if at is None else f"{over} {at:g}" if at == swept[0] else f"{at:g}" for at in columns)
    return Table(("streams", "variant", "quantity", *names), tuple(body))


def _spread(values: Sequence[float], most: int) -> list[float]:
    """At most so many of them, the ends included."""
    if len(values) <= most:
        return list(values)
    return [values[round(k * (len(values) - 1) / (most - 1))] for k in range(most)]


def _cell(row: Row) -> str:
    if row.value is None:
        return NOT_THERE
    text = number(row.value)
    if row.low is not None and row.high is not None:
        text += f" ({number(row.low)} to {number(row.high)})"
    if row.paper is not None:
        text += f"; paper {number(row.paper)}"
    return text


def number(value: float) -> str:
    """Three digits."""
    return f"{value:.0f}" if abs(value) >= 100 or value == int(value) else f"{value:.3g}"
