"""A frame of a run as an SVG picture."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from modt.geometry import corners
from modt.reporting.page import THEME
from modt.sinks.output import writing
from modt.sinks.tracks import BOX_KEYS
from modt.types import Float64, Int
from modt.viewer import look
from modt.viewer.point_cells import SIDE, Cells
from modt.viewer.recorded_run import RecordedRun
from modt.viewer.track_rows import COLUMNS, SCALE, SCALED

REACH_M, SIDE_M = 45.0, 32.0
"""Half of what is shown ahead and behind, and to the left and right."""
TRAIL = 30
"""Frames."""
MOST_CELLS = 50_000
"""Of a sweep, to keep the file below a megabyte or so."""
_LINE_M = 0.1
_STYLE = """
svg{background:var(--paper);font-family:system-ui,sans-serif}
text{fill:var(--ink);font-size:1.1px;paint-order:stroke;stroke:var(--paper);stroke-width:.3px}
.soft{fill:var(--soft)}.axis{fill:none;stroke:var(--line);stroke-width:.1}
.ground,.above{fill:none;stroke-linecap:square}.ground{stroke:var(--line)}.above{stroke:var(--soft)}
.ring{fill:none;stroke:var(--ink);stroke-width:.12}.trail{fill:none;stroke-width:.15}.ego{fill:var(--ink)}
"""


def save_picture(path: Path, run: RecordedRun, at: int, step_cm: int, cells: Cells | None) -> None:
    """Write a frame of a run, x forward to the right.

    Raises:
        ModtError: it cannot be written.
    """
    with writing(path):
        path.write_text(picture(run, at, step_cm, cells), encoding="utf-8")


def picture(run: RecordedRun, at: int, step_cm: int, cells: Cells | None) -> str:
    """SVG text of a frame: points, tracks, and what the frame cost.

    Args:
        run: what is recorded.
        at: index of the frame.
        step_cm: width of a cell.
        cells: of the sweep, None without points.
    """
    view = f"{-REACH_M} {-SIDE_M} {2 * REACH_M} {2 * SIDE_M}"
    rows = run.tracks[run.tracks[:, COLUMNS.index("at")] == at]
    rows = rows[np.argsort(rows[:, COLUMNS.index("class")], kind="stable")]
    rings = "".join(f'<circle class="axis" r="{r}"/>' for r in (20, 40, 60))
    return "".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" width="1280" role="img">',
            f"<title>{escape(run.facts['stream']['name'])}, frame {run.frames[at]['frame']}</title>",
            f"<style>{THEME}{_STYLE}</style>{rings}",
            "" if cells is None else _points(cells, step_cm),
            '<path class="ego" d="M1 0L-.7 .6L-.7 -.6z"/>',
            *(_track(run, at, row) for row in rows),
            _text(run, at),
            "</svg>\n",
        ]
    )


def _points(cells: Cells, step_cm: int) -> str:
    x, y = ((v + 0.5 - SIDE / 2) * step_cm / 100 for v in (cells.cell % SIDE, cells.cell // SIDE))
    shown = (np.abs(x) < REACH_M) & (np.abs(y) < SIDE_M)
    width = max(_LINE_M, step_cm / 100)
    paths = []
    for name, group in (("ground", cells.level == 0), ("above", cells.level > 0)):
        dots = "".join(f"M{u:.2f} {-v:.2f}h0" for u, v in zip(x[shown & group], y[shown & group], strict=True))
        paths.append(f'<path class="{name}" stroke-width="{width}" d="{dots}"/>')
    return "".join(paths)


def _track(run: RecordedRun, at: int, row: Int) -> str:
    """Box, trail, label and ring of a row of the table."""
    value = dict(zip(COLUMNS, row.tolist(), strict=True)) | _scaled(row)
    name, colour = look.classes()[int(value["class"])].values()
    box = np.array([[value[key] for key in BOX_KEYS]])
    outline = " ".join(f"{u:.2f},{-v:.2f}" for u, v in corners(box)[0])
    state = look.states(run.states)[int(value["state"])]
    is_object, dash = value["class"] > 0, "" if value["seen"] else ' stroke-dasharray=".5 .4"'
    parts = [
        f'<polygon points="{outline}" fill="{colour}" fill-opacity="{0.35 if is_object else 0.1}" '
        f'stroke="{state["colour"]}" stroke-width="{0.2 if is_object else 0.08}"{dash}>'
        f"<title>#{value['id']:g} {name}, {state['name']}</title></polygon>"
    ]
    x, y = value["x"], -value["y"]
    if value["classified"]:
        parts.append(f'<circle class="ring" cx="{x:.2f}" cy="{y:.2f}" r="{max(1.0, 0.7 * value["l"]):.2f}"/>')
    if is_object:
        points = " ".join(f"{u:.2f},{-v:.2f}" for u, v in _trail(run, at, int(value["id"])))
        parts.append(f'<polyline class="trail" stroke="{colour}" points="{points}"/>')
        if value["world_speed_mps"] > 0.5:
            heading, reach = value["world_heading"] - run.poses[at, 2], value["world_speed_mps"]
            u, v = x + reach * np.cos(heading), y - reach * np.sin(heading)
            parts.append(f'<path class="trail" stroke="{state["colour"]}" d="M{x:.2f} {y:.2f}L{u:.2f} {v:.2f}"/>')
        said = f"#{value['id']:g} {name} {100 * value[f'p_{name}']:.0f} %"
        parts.append(f'<text x="{x:.2f}" y="{y - 1.2:.2f}">{said}</text>')
    return "".join(parts)


def _scaled(row: Int) -> dict[str, float]:
    return {name: row[COLUMNS.index(name)] / SCALE[name] for name in SCALED}


def _trail(run: RecordedRun, at: int, id_: int) -> Float64:
    """(n, 2) past positions of a track in the frame of the sensor now [m]."""
    now, world = run.tracks[:, COLUMNS.index("at")], COLUMNS.index("world_x")
    rows = run.tracks[(run.tracks[:, 0] == id_) & (now <= at) & (now >= at - TRAIL)]
    x, y, yaw = run.poses[at]
    dx, dy = (rows[:, world : world + 2] / 100 - [x, y]).T
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * dx + s * dy, c * dy - s * dx], axis=1)


def _text(run: RecordedRun, at: int) -> str:
    """What the frame was and cost, and the legends."""
    frame = run.frames[at]
    facts = [f"frame {frame['frame']}, {frame['stamp_s']:.2f} s, mode {run.facts['mode']}"]
    facts.append(f"{frame['proposals']} proposals, budget {run.budget}")
    facts.append(f"{frame['classifications']} classified, {frame['deferred']} deferred")
    if "cpu_ms" in frame:
        facts.append(f"{sum(frame['cpu_ms'].values()):.1f} ms of CPU time")
    if "energy_mJ" in frame:
        facts.append(f"{frame['energy_mJ']:.0f} mJ ({frame['kind']})")
    lines = [f'<text x="{1 - REACH_M}" y="{2.2 - SIDE_M + 1.5 * k}">{escape(f)}</text>' for k, f in enumerate(facts)]
    legend = [("fill", entry) for entry in look.classes()] + [("stroke", entry) for entry in look.states(run.states)]
    for k, (kind, entry) in enumerate(legend):
        y = SIDE_M - 1 - 1.5 * k
        paint = f'fill="{entry["colour"]}"' if kind == "fill" else f'fill="none" stroke="{entry["colour"]}"'
        name = escape(entry["name"].replace("_", " "))
        lines.append(
            f'<rect x="{1 - REACH_M}" y="{y - 0.8}" width=".8" height=".8" stroke-width=".2" {paint}/>'
            f'<text class="soft" x="{2.4 - REACH_M}" y="{y}">{name}</text>'
        )
    return "".join(lines)
