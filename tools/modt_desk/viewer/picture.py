"""A frame of a run, x forward to the right, drawn on a canvas."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from modt.geometry import corners
from modt.sinks.tracks import BOX_KEYS
from modt.types import Float64, Int
from modt.viewer import look
from modt.viewer.look import REACH_M
from modt.viewer.point_cells import SIDE, Cells
from modt.viewer.track_rows import COLUMNS, SCALE, SCALED
from modt_desk.viewer.canvas import SIDE_M, Canvas
from modt_desk.viewer.caption import caption
from modt_desk.viewer.extent import RINGS_M, reach_m
from modt_desk.viewer.labels import Labels
from modt_desk.viewer.recorded_run import RecordedRun
from modt_desk.viewer.zoomed import Zoomed

TRAIL = 30
"""Frames."""
MOST_CELLS = 50_000
"""Of a sweep, to keep an SVG file below a megabyte or so."""
Label = tuple[float, float, str, str]
_LEAST_M = 0.1
_GAP_M = 0.3
"""Between a box and its label."""


def draw(canvas: Canvas, run: RecordedRun, at: int, step_cm: int, cells: Cells | None) -> None:
    """Draw points, tracks, truth, and what the frame cost.

    Args:
        canvas: drawn on.
        run: what is recorded.
        at: index of the frame.
        step_cm: width of a cell.
        cells: of the sweep, None without points.
    """
    reach = reach_m(run.tracks)
    scene, labels = Zoomed(canvas, REACH_M / reach), Labels(canvas)
    rings = np.arange(RINGS_M[reach], math.hypot(reach, reach * SIDE_M / REACH_M), RINGS_M[reach]).tolist()
    for radius in rings:
        scene.circle(0, 0, radius, "line", 0.1)
    if cells is not None:
        _points(scene, cells, step_cm)
    for radius in rings:
        labels.write(0.0, -scene.factor * radius, f"{radius:g} m", "soft")
    canvas.polygon(np.array([[1, 0], [-0.7, 0.6], [-0.7, -0.6]]), "ink", 1.0, "ink", 0.05)
    labels.keep_free(-1.0, 1.0, 0.6)
    rows = run.tracks[run.tracks[:, COLUMNS.index("at")] == at]
    false = set(run.frames[at].get("false", ()))
    said = []
    for row in rows[np.argsort(rows[:, COLUMNS.index("class")], kind="stable")]:
        said += _track(scene, run, at, row, int(row[0]) in false)
    for labelled in run.frames[at].get("truth", ()):
        said += _truth(scene, labelled)
    caption(canvas, labels, run, at)
    for u, v, text, colour in reversed(said):
        labels.write(scene.factor * u, scene.factor * v - _GAP_M, text, colour)


def _points(scene: Zoomed, cells: Cells, step_cm: int) -> None:
    x, y = ((v + 0.5 - SIDE / 2) * step_cm / 100 for v in (cells.cell % SIDE, cells.cell // SIDE))
    shown = (np.abs(x) < REACH_M / scene.factor) & (np.abs(y) < SIDE_M / scene.factor)
    for colour, group in (("line", cells.level == 0), ("soft", cells.level > 0)):
        which = shown & group
        width = max(_LEAST_M / scene.factor, step_cm / 100)
        scene.dots(np.stack([x[which], -y[which]], axis=1), colour, width)


def _track(scene: Zoomed, run: RecordedRun, at: int, row: Int, false: bool) -> list[Label]:
    """Box, trail and ring of a row of the table; its label."""
    value = dict(zip(COLUMNS, row.tolist(), strict=True)) | _scaled(row)
    name, colour = look.classes()[int(value["class"])].values()
    state = look.states(run.states)[int(value["state"])]
    is_object, wrong = value["class"] > 0, look.truth()["false"]["colour"]
    box = _outline([value[key] for key in BOX_KEYS])
    scene.polygon(
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
        scene.circle(x, y, max(1.0 / scene.factor, 0.7 * value["l"]), "ink", 0.12)
    if not is_object:
        return []
    scene.line(_trail(run, at, int(value["id"])), colour, 0.15)
    if value["world_speed_mps"] > 0.5:
        heading, reach = value["world_heading"] - run.poses[at, 2], value["world_speed_mps"]
        ahead = [x + reach * np.cos(heading), y - reach * np.sin(heading)]
        scene.line(np.array([[x, y], ahead]), state["colour"], 0.15)
    said = f"{'false: ' if false else ''}#{value['id']:g} {name} {100 * value[f'p_{name}']:.0f} %"
    return [(x, _top(box), said, wrong if false else "ink")]


def _truth(scene: Zoomed, labelled: dict[str, Any]) -> list[Label]:
    colour, missed = look.truth()[labelled["outcome"]]["colour"], labelled["outcome"] == "missed"
    box = _outline([labelled["x"], labelled["y"], 0.0, labelled["l"], labelled["w"], 0.0, labelled["yaw"]])
    scene.polygon(box, colour, 0.0, colour, 0.3 if missed else 0.12, dash=0.25)
    text = f"missed {look.classes()[labelled['class']]['name']}"
    return [(labelled["x"], _top(box), text, colour)] if missed else []


def _top(box: Float64) -> float:
    return float(box[:, 1].min())


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
