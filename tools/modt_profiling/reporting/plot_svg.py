"""SVG of a plot, in the colours of the page, by Matplotlib."""

from __future__ import annotations

import io

import matplotlib as mpl
from cycler import cycler
from markupsafe import Markup
from matplotlib.figure import Figure

from modt.viewer.theme import COLOURS, LIGHT
from modt_profiling.reporting.document import CHART_IN, Plot

_LEGEND_COLUMNS = 2
_STYLE = {
    "axes.edgecolor": LIGHT["soft"],
    "axes.formatter.min_exponent": 4,  # numbers of a logarithmic axis are written out below 10 000
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.labelcolor": LIGHT["soft"],
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.xmargin": 0.02,
    "axes.axisbelow": True,
    "font.size": 9.0,
    "grid.color": LIGHT["line"],
    "legend.columnspacing": 1.2,
    "legend.frameon": False,
    "legend.handlelength": 1.2,
    "legend.labelcolor": LIGHT["soft"],
    "savefig.transparent": True,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "modt",  # the same plot is the same text
    "text.color": LIGHT["soft"],
    "xtick.color": LIGHT["soft"],
    "ytick.color": LIGHT["soft"],
}
_NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def svg(plot: Plot) -> Markup:
    """SVG of a plot, in the colours of the page; a line of one point has a mark."""
    with mpl.rc_context(_STYLE):
        figure = Figure(plot.size_in, layout="constrained")
        axes = figure.add_subplot()
        plot.draw(axes)
        for line in axes.lines:
            if len(line.get_xdata()) == 1:
                line.set_marker("o")
        if plot.size_in == CHART_IN and axes.get_legend_handles_labels()[1]:
            figure.legend(loc="outside lower center", ncols=_LEGEND_COLUMNS)
        file = io.StringIO()
        figure.savefig(file, format="svg", metadata=_NO_METADATA)
    text = file.getvalue()
    for name in ("soft", "line"):
        text = text.replace(LIGHT[name], f"var(--{name})")
    return Markup(text[text.index("<svg") :])  # Matplotlib has escaped the names
