"""Charts of experiments, drawn by Matplotlib (extra `view`)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from modt_desk.experiments.catalogue.experiment import Chart, Experiment
from modt_desk.experiments.study import DEFAULT, Row


def draw(out: Path, experiment: Experiment, rows: Sequence[Row]) -> None:
    """Write every chart of an experiment as SVG and PNG, for each group of drives and each profile."""
    for streams, names in dict.fromkeys((row.streams, row.profile) for row in rows):
        title = streams if names == DEFAULT else f"{streams}, {names}"
        for chart in experiment.charts:
            own = [
                row
                for row in rows
                if (row.streams, row.profile) == (streams, names) and row.quantity in chart.quantities
            ]
            drawn = [row for row in own if row.value is not None]
            if any(row.at is not None for row in drawn):
                name = re.sub(r"[^\w.]+", "-", f"{experiment.name}-{title}-{chart.title}")
                _draw(out / name, f"{experiment.title}\n{title}", chart, drawn)


def _draw(path: Path, title: str, chart: Chart, rows: Sequence[Row]) -> None:
    """A line for each variant and quantity, a dashed one across where nothing is swept."""
    figure = Figure(figsize=(8, 5), dpi=150, layout="constrained")
    axes = figure.subplots()
    swept = [row.at for row in rows if row.at is not None]
    for variant, quantity in dict.fromkeys((row.variant, row.quantity) for row in rows):
        own = [row for row in rows if (row.variant, row.quantity) == (variant, quantity)]
        name = f"{variant}, {quantity}" if len(chart.quantities) > 1 else variant
        at, value = np.array([(row.at, row.value) for row in own], np.float64).T
        if own[0].at is None:
            axes.plot((min(swept), max(swept)), value.repeat(2), "--", label=name)
        else:
            axes.plot(at, value, label=name)
    axes.set(title=title, xlabel=chart.x_label, ylabel=chart.y_label)
    axes.grid(alpha=0.3)
    axes.legend()
    with matplotlib.rc_context({"svg.hashsalt": path.name}):  # the same figures give the same bytes
        figure.savefig(f"{path}.svg", metadata={"Date": None})
    figure.savefig(f"{path}.png")
