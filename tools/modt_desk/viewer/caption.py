"""What stands beside a frame of a run: what it was and cost, and the legends."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from modt.viewer import look
from modt.viewer.look import REACH_M
from modt_desk.viewer.canvas import SIDE_M, Canvas
from modt_desk.viewer.labels import LETTER_M, Labels
from modt_desk.viewer.recorded_run import RecordedRun

_LINE_M = 1.5
"""From one line of text to the next."""
_DATES_S = 1e8
"""Stamps from here on count from 1970."""


def caption(canvas: Canvas, labels: Labels, run: RecordedRun, at: int) -> None:
    """Write what the frame was and cost, and the legends, where labels find no room then."""
    frame = run.frames[at]
    facts = [f"frame {frame['frame']}, {_time(frame['stamp_s'])}, mode {run.facts['mode']}"]
    facts.append(f"{frame['proposals']} proposals, budget {run.budget}")
    facts.append(f"{frame['classifications']} classified, {frame['deferred']} deferred")
    if "cpu_ms" in frame:
        facts.append(f"{sum(frame['cpu_ms'].values()):.1f} ms of CPU time")
    if "energy_mJ" in frame:
        facts.append(f"{frame['energy_mJ']:.0f} mJ ({frame['kind']})")
    _panel(canvas, labels, facts, -SIDE_M)
    for k, fact in enumerate(facts):
        canvas.text(1 - REACH_M, 2.2 - SIDE_M + _LINE_M * k, fact, "ink")
    legend = [(entry, 1.0) for entry in look.classes()] + [(entry, 0.0) for entry in look.states(run.states)]
    legend += [(entry, 0.0) for entry in look.truth().values()] if "truth" in frame else []
    _panel(canvas, labels, [f"-- {entry['name']}" for entry, _ in legend], SIDE_M - _LINE_M * (len(legend) + 0.6))
    for k, (entry, opacity) in enumerate(legend):
        u, v = 1 - REACH_M, SIDE_M - 1 - _LINE_M * k
        square = np.array([[u, v - 0.8], [u + 0.8, v - 0.8], [u + 0.8, v], [u, v]])
        canvas.polygon(square, entry["colour"], opacity, entry["colour"], 0.2)
        canvas.text(u + 1.4, v, entry["name"].replace("_", " "), "soft")


def _panel(canvas: Canvas, labels: Labels, lines: Sequence[str], top: float) -> None:
    """Paper below lines of text at the left edge, so that they can be read."""
    right, foot = 1.5 - REACH_M + LETTER_M * max(map(len, lines)), top + _LINE_M * (len(lines) + 0.6)
    corners = np.array([[-REACH_M, top], [right, top], [right, foot], [-REACH_M, foot]])
    canvas.polygon(corners, "paper", 0.85, "paper", 0.0)
    for k in range(len(lines)):
        labels.keep_free(-REACH_M, right, top + _LINE_M * (k + 1))


def _time(stamp_s: float) -> str:
    """Seconds from the begin of a recording, or a date."""
    if stamp_s < _DATES_S:
        return f"{stamp_s:.2f} s"
    return f"{datetime.fromtimestamp(stamp_s, UTC):%Y-%m-%d %H:%M:%S.%f}"[:-4]
