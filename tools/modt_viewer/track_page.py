"""Page of a track: its states, views and motion, and how its class followed from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape

import numpy as np

from modt.classes import CLASS_NAMES, CLASSES
from modt.errors import MisuseError
from modt.sinks.tracks import BOX_KEYS
from modt.sources.stream import Stream
from modt.types import Float32
from modt.viewer.track_rows import COLUMNS, SCALE
from modt_profiling.reporting import svg
from modt_profiling.reporting.document import Plot, page, plots, tiles
from modt_viewer.crop_picture import crop_picture
from modt_viewer.recorded_run import RecordedRun

Row = dict[str, float]


def rows_of(run: RecordedRun, id_: int) -> list[Row]:
    """Recorded rows of a track, frame by frame [m, rad, m/s].

    Raises:
        MisuseError: there is no such track.
    """
    table = run.tracks[run.tracks[:, COLUMNS.index("id")] == id_]
    if not len(table):
        raise MisuseError(f"--track {id_}", "is not recorded", "point at a box in the page of the run for its number")
    scales = [SCALE.get(name, 1) for name in COLUMNS]
    return [dict(zip(COLUMNS, row, strict=True)) for row in (table / scales).tolist()]


def views(run: RecordedRun, rows: list[Row], stream: Stream | None) -> dict[int, Float32]:
    """(N, 4) points of the sweeps in which a track was classified, by index of the frame."""
    wanted = {run.numbers[int(row["at"])]: int(row["at"]) for row in rows if row["classified"]}
    if stream is None or not wanted:
        return {}
    frames = stream.between(min(wanted), max(wanted) + 1)
    return {wanted[frame.index]: frame.points for frame in frames if frame.index in wanted}


def track_page(run: RecordedRun, rows: list[Row], sweeps: Mapping[int, Float32]) -> str:
    """HTML of the page that explains the class of a track."""
    first, last = rows[0], rows[-1]
    number = {int(row["at"]): run.numbers[int(row["at"])] for row in rows}
    classified = [row for row in rows if row["classified"]]
    spent_mJ = sum(run.frames[int(row["at"])].get("call_mJ", 0.0) for row in classified)
    settled = settled_from(rows)
    facts = [
        ("reported at the end", CLASS_NAMES[int(last["class"])], f"posterior {_reported(last)}"),
        ("followed", f"{len(rows)} frames", f"{number[int(first['at'])]} to {number[int(last['at'])]}"),
        ("classifications", f"{len(classified)}", f"{sum(r['seen'] > 0 for r in rows)} by tracking by detection"),
        ("energy of classification", f"{spent_mJ:.1f} mJ", "estimated"),
        ("settled from frame", "never", "its class may change in the next frame")
        if settled is None
        else ("settled from frame", f"{number[int(settled['at'])]}", f"{_reported(settled)} then"),
    ]
    blocks = [tiles(facts), plots(_plots(run, rows)), *_events(run, rows, sweeps)]
    about = f"{run.facts['stream']['name']}, mode {run.facts['mode']}: from proposal to class"
    return page(f"Track {first['id']:g}", about, blocks)


def settled_from(rows: list[Row]) -> Row | None:
    """The frame from which a track keeps its last class as a final one, to its end; None if that is not final."""
    settled = None
    for row in reversed(rows):
        if not row["final"] or row["class"] != rows[-1]["class"]:
            break
        settled = row
    return settled


def _plots(run: RecordedRun, rows: list[Row]) -> Iterator[Plot]:
    frame = np.array([run.numbers[int(row["at"])] for row in rows], float)
    posterior, motion = (
        [
            svg.Trace(c, frame, np.array([row[f"{key}_{c}"] for row in rows]), colour=spec.colour)
            for c, spec in zip(CLASS_NAMES, CLASSES.values(), strict=True)
        ]
        for key in ("p", "motion")
    )
    yield (
        "Posterior",
        svg.lines(posterior, "frame", "probability"),
        "after each frame, of views, box sizes and motion",
    )
    yield "Motion", svg.lines(motion[1:], "frame", "log-likelihood"), "of its motion, over that of background"
    points = svg.Trace("", frame, np.array([row["points"] for row in rows]))
    yield "Points", svg.lines([points], "frame", "points"), "of its last proposal"


def _events(run: RecordedRun, rows: list[Row], sweeps: Mapping[int, Float32]) -> Iterator[str]:
    """A block for each classification and each change of the state or of the class that is reported."""
    before: Row | None = None
    for row in rows:
        at, sentences = int(row["at"]), []
        if row["classified"]:
            posterior = ", ".join(f"{c} {100 * row[f'p_{c}']:.1f} %" for c in CLASS_NAMES)
            motion = ", ".join(f"{c} {row[f'motion_{c}']:+.1f}" for c in CLASS_NAMES[1:])
            where = f"{np.hypot(row['x'], row['y']):.0f} m away, {row['l']:.1f} × {row['w']:.1f} × {row['h']:.1f} m"
            call_mJ = run.frames[at].get("call_mJ", 0.0)
            sentences.append(f"Classified, {row['points']:g} points, {where}, {call_mJ:.1f} mJ.")
            sentences.append(f"Posterior: {posterior}.")
            sentences.append(f"Motion, log-likelihood over background: {motion}.")
        if before is None or row["state"] != before["state"]:
            state = run.states[int(row["state"])].replace("_", " ")
            sentences.append(f"Begins as {state}." if before is None else f"Becomes {state}.")
        if before is None or row["class"] != before["class"]:
            sentences.append(f"Reported as {_reported(row)}.")
        if row["final"] and not (before and before["final"]):
            sentences.append(f"The class is settled: {_reported(row)}. A better view may still change it.")
        if before and before["final"] and not row["final"]:
            sentences.append("The class is open.")
        if sentences:
            pictures = crop_picture([row[key] for key in BOX_KEYS], sweeps[at]) if at in sweeps else ""
            lines = "<br>".join(map(escape, sentences))
            yield f"<section><h2>Frame {run.numbers[at]}</h2><p>{lines}</p>{pictures}</section>"
        before = row


def _reported(row: Row) -> str:
    """The class that is reported, with its own probability; with a question mark below one half."""
    name = CLASS_NAMES[int(row["class"])]
    doubt = "?" if row["class"] and row[f"p_{name}"] < 0.5 else ""
    return f"{name}{doubt} {100 * row[f'p_{name}']:.1f} %"
