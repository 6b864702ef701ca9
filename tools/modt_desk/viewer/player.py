"""A run as one HTML page that plays it, from a file and without a network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from modt.sinks.output import writing
from modt.viewer import theme
from modt.viewer.html_page import content, page
from modt.viewer.packed import packed_cells, packed_table
from modt.viewer.point_cells import Cells
from modt_desk.viewer.recorded_run import RecordedRun
from modt_desk.viewer.recorded_tracks import reach_m
from modt_desk.viewer.truth_marks import LEGEND

SCRIPT = Path(__file__).parent / "recorded.js"
POINT_BYTES = 20_000_000
"""Approximate size of the points of a page."""
CELL_BYTES = 1.5
"""Size of a cell, compressed and in base64."""


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
        run.facts["stream"]["name"], about, _content(run, start, None if sweeps is None else step_cm), SCRIPT
    )
    with writing(path), path.open("w", encoding="utf-8") as file:
        file.write(head)
        file.write(_data("tracks", packed_table(run.tracks)))
        for at, cells in enumerate(sweeps or ()):
            file.write(_data(f"points-{at}", packed_cells(cells)))
        file.write(tail)


def _content(run: RecordedRun, start: int, step_cm: int | None) -> dict[str, Any]:
    """Content of the page beside the columns."""
    poses = run.poses.round(4).tolist()
    frames = [_rounded(f | {"pose": pose}) for f, pose in zip(run.frames, poses, strict=True)]
    judged = any("truth" in frame for frame in run.frames)
    return content(theme.states(run.states), run.budget, step_cm) | {
        "frames": frames,
        "truth": LEGEND if judged else None,
        "reach_m": reach_m(run.tracks),
        "start": start,
    }


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_rounded(entry) for entry in value]
    return round(value, 3) if isinstance(value, float) else value


def _data(name: str, text: str) -> str:
    return f'<script type="text/plain" id="{name}">{text}</script>\n'
