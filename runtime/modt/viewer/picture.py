"""A frame of a run, x forward to the right, drawn on a canvas."""

from __future__ import annotations

from typing import Any

import numpy as np

from modt.geometry import corners
from modt.sinks.tracks import BOX_KEYS
from modt.types import Float64, Int
from modt.viewer import look
from modt.viewer.canvas import REACH_M, SIDE_M, Canvas
from modt.viewer.labels import Labels
from modt.viewer.point_cells import SIDE, Cells
from modt.viewer.recorded_run import RecordedRun
from modt.viewer.track_rows import COLUMNS, SCALE, SCALED

TRAIL = 30
"""Frames."""
MOST_CELLS = 50_000
"""Of a sweep, to keep an SVG file below a megabyte or so."""
Label = tuple[float, float, str, str]
_LEAST_M = 0.1
_LINE_M = 1.5
"""From one line of text to the next."""


def draw(canvas: Canvas, run: RecordedRun, at: int, step_cm: int, cells: Cells | None) -> None:
    """Draw points, tracks, truth, and what the frame cost.

    Args:
        canvas: drawn on.
        run: what is recorded.
        at: index of the frame.
        step_cm: width of a cell.
        cells: of the sweep, None without points.
    """
    for radius in (20, 40, 60):
        canvas.circle(0, 0, radius, "line", 0.1)
    if cells is not None:
        _points(canvas, cells, step_cm)
    canvas.polygon(np.array([[1, 0], [-0.7, 0.6], [-0.7, -0.6]]), "ink", 1.0, "ink", 0.05)
    rows = run.tracks[run.tracks[:, COLUMNS.index("at")] == at]
    false = set(run.frames[at].get("false", ()))
    labels = Labels(canvas)
    said = []
    for row in rows[np.argsort(rows[:, COLUMNS.index("class")], kind="stable")]:
        said += _track(canvas, run, at, row, int(row[0]) in false)
    for labelled in run.frames[at].get("truth", ()):
        said += _truth(canvas, labelled)
    for label in reversed(said):
        labels.write(*label)
    _text(canvas, run, at)


def _points(canvas: Canvas, cells: Cells, step_cm: int) -> None:
    x, y = ((v + 0.5 - SIDE / 2) * step_cm / 100 for v in (cells.cell % SIDE, cells.cell // SIDE))
    shown = (np.abs(x) < REACH_M) & (np.abs(y) < SIDE_M)
    for colour, group in (("line", cells.level == 0), ("soft", cells.level > 0)):
        which = shown & group
        canvas.dots(np.stack([x[which], -y[which]], axis=1), colour, max(_LEAST_M, step_cm / 100))


def _track(canvas: Canvas, run: RecordedRun, at: int, row: Int, false: bool) -> list[Label]:
    """Box, trail and ring of a row of the table; its label."""
    value = dict(zip(COLUMNS, row.tolist(), strict=True)) | _scaled(row)
    name, colour = look.classes()[int(value["class"])].values()
    state = look.states(run.states)[int(value["state"])]
    is_object, wrong = value["class"] > 0, look.truth()["false"]["colour"]
    box = _outline([value[key] for key in BOX_KEYS])
    canvas.polygon(
        box,
        colour,
        0.35 if is_object else 0.1,
        wrong if false else state["colour"],
        (0.4 if false else 0.2) if is_object else 0.08,
        dash=0 if value["seen"] else 0.5,
        title=f"#{value['id']:g} {name}, {state['name']}",
    )
    x, y = value["x"], -value["y"]
    if value["classified"]:
        canvas.circle(x, y, max(1.0, 0.7 * value["l"]), "ink", 0.12)
    if not is_object:
        return []
    canvas.line(_trail(run, at, int(value["id"])), colour, 0.15)
    if value["world_speed_mps"] > 0.5:
        heading, reach = value["world_heading"] - run.poses[at, 2], value["world_speed_mps"]
        ahead = [x + reach * np.cos(heading), y - reach * np.sin(heading)]
        canvas.line(np.array([[x, y], ahead]), state["colour"], 0.15)
    said = f"{'false: ' if false else ''}#{value['id']:g} {name} {100 * value[f'p_{name}']:.0f} %"
    return [(x, _top(box), said, wrong if false else "ink")]


def _truth(canvas: Canvas, labelled: dict[str, Any]) -> list[Label]:
    colour, missed = look.truth()[labelled["outcome"]]["colour"], labelled["outcome"] == "missed"
    box = _outline([labelled["x"], labelled["y"], 0.0, labelled["l"], labelled["w"], 0.0, labelled["yaw"]])
    canvas.polygon(box, colour, 0.0, colour, 0.3 if missed else 0.12, dash=0.25)
    text = f"missed {look.classes()[labelled['class']]['name']}"
    return [(labelled["x"], _top(box), text, colour)] if missed else []


def _top(box: Float64) -> float:
    return float(box[:, 1].min()) - 0.3


def _outline(box: list[float]) -> Float64:
    """(4, 2) corners on the canvas of a box in the frame of the sensor."""
    outline: Float64 = corners(np.array([box]))[0] * [1, -1]
    return outline


def _scaled(row: Int) -> dict[str, float]:
    return {name: row[COLUMNS.index(name)] / SCALE[name] for name in SCALED}


def _trail(run: RecordedRun, at: int, id_: int) -> Float64:
    """(n, 2) past positions of a track on the canvas, as seen from the sensor now."""
    now, world = run.tracks[:, COLUMNS.index("at")], COLUMNS.index("world_x")
    rows = run.tracks[(run.tracks[:, 0] == id_) & (now <= at) & (now >= at - TRAIL)]
    x, y, yaw = run.poses[at]
    dx, dy = (rows[:, world : world + 2] / 100 - [x, y]).T
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * dx + s * dy, s * dx - c * dy], axis=1)


def _text(canvas: Canvas, run: RecordedRun, at: int) -> None:
    """What the frame was and cost, and the legends."""
    frame = run.frames[at]
    facts = [f"frame {frame['frame']}, {frame['stamp_s']:.2f} s, mode {run.facts['mode']}"]
    facts.append(f"{frame['proposals']} proposals, budget {run.budget}")
    facts.append(f"{frame['classifications']} classified, {frame['deferred']} deferred")
    if "cpu_ms" in frame:
        facts.append(f"{sum(frame['cpu_ms'].values()):.1f} ms of CPU time")
    if "energy_mJ" in frame:
        facts.append(f"{frame['energy_mJ']:.0f} mJ ({frame['kind']})")
    for k, fact in enumerate(facts):
        canvas.text(1 - REACH_M, 2.2 - SIDE_M + _LINE_M * k, fact, "ink")
    legend = [(entry, 1.0) for entry in look.classes()] + [(entry, 0.0) for entry in look.states(run.states)]
    legend += [(entry, 0.0) for entry in look.truth().values()] if "truth" in frame else []
    for k, (entry, opacity) in enumerate(legend):
        u, v = 1 - REACH_M, SIDE_M - 1 - _LINE_M * k
        square = np.array([[u, v - 0.8], [u + 0.8, v - 0.8], [u + 0.8, v], [u, v]])
        canvas.polygon(square, entry["colour"], opacity, entry["colour"], 0.2)
        canvas.text(u + 1.4, v, entry["name"].replace("_", " "), "soft")
