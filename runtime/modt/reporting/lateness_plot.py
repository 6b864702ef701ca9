"""How late the frames of a service began."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from modt.reporting import svg
from modt.reporting.page import Plot
from modt.sinks.run_directory import SUMMARY


def lateness_plots(run: Path) -> list[Plot]:
    """A plot from the summary of a service that has ended, none of another run."""
    path = run / SUMMARY
    late = json.loads(path.read_text(encoding="utf-8")).get("lateness", {}) if path.is_file() else {}
    if not late.get("frames"):
        return []
    trace = svg.Trace("", np.array(late["ms"], float), np.array(late["frames"], float))
    plot = svg.lines([trace], "from the arrival of the sweep [ms]", "frames as late or later", log=True)
    return [("Lateness", plot, "measured")]
