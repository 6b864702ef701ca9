"""Charts of experiments: SVG that stands alone, and for pages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from modt.reporting import svg
from modt.reporting.page import COLOURS
from modt_desk.experiments.catalogue.experiment import Chart, Experiment
from modt_desk.experiments.study import DEFAULT, Row

_LINE_PX = 16
_STYLE = (  # fonts by name: what makes a PNG of it knows no system-ui
    "text{font:11px system-ui,'DejaVu Sans','Liberation Sans','Noto Sans',Arial,Helvetica,sans-serif;fill:#5d6876}"
    ".end{text-anchor:end}.mid{text-anchor:middle}"
    ".grid{stroke:#d8dde4}.axis{stroke:#5d6876}polyline{fill:none;stroke-width:2}"
    + "".join(f".l{k}{{stroke:{c}}}.c{k}{{fill:{c}}}" for k, c in enumerate(COLOURS))
)


def drawings(experiment: Experiment, rows: Sequence[Row]) -> Iterator[tuple[str, Chart, list[svg.Trace]]]:
    """The charts of some streams, with their name, that of the profiles added where it is not the default."""
    for streams, names in dict.fromkeys((row.streams, row.profile) for row in rows):
        own = [row for row in rows if (row.streams, row.profile) == (streams, names)]
        for chart in experiment.charts:
            drawn = traces(chart, own)
            if drawn:
                yield streams if names == DEFAULT else f"{streams}, {names}", chart, drawn


def traces(chart: Chart, rows: Sequence[Row]) -> list[svg.Trace]:
    """A line for each variant and quantity; where nothing is swept, a dashed one across."""
    drawn = [row for row in rows if row.quantity in chart.quantities and row.value is not None]
    swept = [row.at for row in drawn if row.at is not None]
    found = []
    for variant, quantity in dict.fromkeys((row.variant, row.quantity) for row in drawn):
        own = [row for row in drawn if (row.variant, row.quantity) == (variant, quantity)]
        name = ", ".join(dict.fromkeys((variant, quantity) if len(chart.quantities) > 1 else (variant,)))
        pairs = [(row.at, row.value) for row in own if row.at is not None]
        if pairs:
            found.append(svg.Trace(name, *np.array(pairs, np.float64).T))
        elif swept:
            ends = np.array([min(swept), max(swept)])
            found.append(svg.Trace(name, ends, np.full(2, own[0].value), dashed=True))
    return found


def picture(chart: Chart, drawn: Sequence[svg.Trace]) -> str:
    """For a page."""
    return svg.lines(drawn, chart.x_label, chart.y_label)


def standalone(title: str, chart: Chart, drawn: Sequence[svg.Trace]) -> str:
    """A file of its own, with style and legend."""
    body = picture(chart, drawn).partition("</svg>")[0].partition(">")[2]
    height = svg.HEIGHT + _LINE_PX * len(drawn)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {svg.WIDTH} {height}"><title>{escape(title)}</title>'
        f'<style>{_STYLE}</style><rect width="100%" height="100%" fill="#fff"/>'
        f"{body}{''.join(_legend(drawn))}</svg>\n"
    )


def _legend(drawn: Sequence[svg.Trace]) -> Iterator[str]:
    for k, trace in enumerate(drawn):
        y = svg.HEIGHT + _LINE_PX * (k + 0.5)
        yield f'<rect class="c{k}" x="{svg.LEFT}" y="{y - 9:g}" width="10" height="10"/>'
        yield f'<text x="{svg.LEFT + 16}" y="{y:g}">{escape(trace.name)}{" (dashed)" * trace.dashed}</text>'
