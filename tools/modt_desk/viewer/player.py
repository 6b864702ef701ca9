"""A run as one HTML page that plays it, from a file and without a network."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import Any

from modt.reporting.page import THEME
from modt.sinks.output import writing
from modt.viewer import look
from modt_desk.viewer.canvas import REACH_M
from modt_desk.viewer.extent import reach_m
from modt.viewer.packed import packed_cells, packed_table
from modt.viewer.point_cells import SIDE, Cells
from modt_desk.viewer.recorded_run import RecordedRun
from modt.viewer.track_rows import COLUMNS, SCALE

POINT_BYTES = 20_000_000
"""Of the points of a page, about."""
CELL_BYTES = 1.5
"""Of a cell, compressed and in base64."""
_PAGE = Path(__file__).parent / "page"
_SCRIPTS = "data", "draw", "text", "input"


def most_cells(n_frames: int) -> int:
    """Cells a sweep that a page of so many frames has room for."""
    return int(POINT_BYTES / CELL_BYTES / n_frames)


def save_player(path: Path, run: RecordedRun, start: int, step_cm: int, sweeps: Iterable[Cells] | None) -> None:
    """Write the page of a run, which opens at a frame.

    Args:
        path: the file.
        run: what is recorded.
        start: index of the frame.
        step_cm: width of a cell.
        sweeps: cells of each frame, None without points.

    Raises:
        ModtError: it cannot be written.
    """
    about = f"mode {run.facts['mode']}, field of view {run.facts.get('fov', 'full')}, profile {run.sensor}"
    if sweeps is None:
        about += "; the source of its points is not found"
    head, tail = page(
        run.facts["stream"]["name"], about, _content(run, start, None if sweeps is None else step_cm), "recorded"
    )
    with writing(path), path.open("w", encoding="utf-8") as file:
        file.write(head)
        file.write(_data("tracks", packed_table(run.tracks)))
        for at, cells in enumerate(sweeps or ()):
            file.write(_data(f"points-{at}", packed_cells(cells)))
        file.write(tail)


def _content(run: RecordedRun, start: int, step_cm: int | None) -> dict[str, Any]:
    """What the page knows beside the columns."""
    poses = run.poses.round(4).tolist()
    frames = [_rounded(f | run.call_mJ(f) | {"pose": pose}) for f, pose in zip(run.frames, poses, strict=True)]
    judged = any("truth" in frame for frame in run.frames)
    return content(look.states(run.states), run.budget, step_cm) | {
        "frames": frames,
        "truth": look.truth() if judged else None,
        "reach_m": reach_m(run.tracks),
        "start": start,
    }


def content(states: list[look.Entry], budget: str | None, step_cm: int | None) -> dict[str, Any]:
    """What each page knows: columns, legends, the budget of a frame, the width of a cell (None without points)."""
    return {
        "schema": "modt.player/2",
        "columns": [(name, SCALE.get(name, 1)) for name in COLUMNS],
        "classes": look.classes(),
        "states": states,
        "stages": look.stages(),
        "budget": budget,
        "points": None if step_cm is None else {"side": SIDE, "step_cm": step_cm},
        "reach_m": REACH_M,
        "frames": [],
    }


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_rounded(entry) for entry in value]
    return round(value, 3) if isinstance(value, float) else value


def page(name: str, about: str, known: dict[str, Any], script: str) -> tuple[str, str]:
    """The page before its data and after them; the script says where its frames come from."""
    css, body = ((_PAGE / f"page.{kind}").read_text(encoding="utf-8") for kind in ("css", "html"))
    scripts = "".join((_PAGE / f"{part}.js").read_text(encoding="utf-8") for part in (*_SCRIPTS, script))
    text = json.dumps(known, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    head = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(name)}</title><style>{THEME}{css}</style></head><body>\n"
        f"<header><h1>{escape(name)}</h1><span>{escape(about)}</span></header>\n{body}"
        f'<script type="application/json" id="run">{text}</script>\n'
    )
    return head, f"<script>\n{scripts}</script></body></html>\n"


def _data(name: str, text: str) -> str:
    return f'<script type="text/plain" id="{name}">{text}</script>\n'
