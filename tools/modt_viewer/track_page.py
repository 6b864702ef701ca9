"""Page of a track: its states, views and motion, and how its class followed from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from modt.classes import CLASS_NAMES, CLASSES
from modt.errors import MisuseError
from modt.publication import KIND_NAMES
from modt.sinks.tracks import BOX_KEYS
from modt.sources.stream import Stream
from modt.types import Float32
from modt.viewer.track_rows import COLUMNS, SCALE
from modt_profiling.reporting.document import Page, Plot, Section
from modt_viewer.crop_picture import crop_pictures
from modt_viewer.recorded_run import RecordedRun

if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.axes import Axes

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


def track_page(run: RecordedRun, rows: list[Row], sweeps: Mapping[int, Float32]) -> Page:
    """Page that explains the class of a track."""
    track = Section(tiles=_facts(run, rows), plots=_plots(run, rows))
    about = f"{run.facts['stream']['name']}, mode {run.facts['mode']}: from proposal to class"
    return Page(f"Track {rows[0]['id']:g}", about, [track, *_events(run, rows, sweeps)])


def _facts(run: RecordedRun, rows: list[Row]) -> list[tuple[str, str, str]]:
    """Name, value and note of what is known of a track at its end."""
    last = rows[-1]
    numbers = [_number(run, row) for row in rows]
    classified = [row for row in rows if row["classified"]]
    spent_mJ = sum(_call_mJ(run, row) for row in classified)
    settled = settled_from(rows)
    return [
        ("reported at the end", KIND_NAMES[int(last["class"])], f"posterior {_reported(last)}"),
        ("tracked", f"{len(rows)} frames", f"{numbers[0]} to {numbers[-1]}"),
        ("classifications", f"{len(classified)}", f"{sum(r['seen'] > 0 for r in rows)} by tracking by detection"),
        ("energy of classification", f"{spent_mJ:.1f} mJ", "estimated"),
        ("settled from frame", "never", "its class may change in the next frame")
        if settled is None
        else ("settled from frame", f"{_number(run, settled)}", f"{_reported(settled)} then"),
    ]


def _number(run: RecordedRun, row: Row) -> int:
    """Number of the frame of a row."""
    return run.numbers[int(row["at"])]


def _call_mJ(run: RecordedRun, row: Row) -> float:
    """Energy of one classification in the frame of a row."""
    return float(run.frames[int(row["at"])].get("call_mJ", 0.0))


def settled_from(rows: list[Row]) -> Row | None:
    """The frame from which a track keeps its last class as a final one, to its end; None if that is not final."""
    settled = None
    for row in reversed(rows):
        if not row["final"] or row["class"] != rows[-1]["class"]:
            break
        settled = row
    return settled


def _plots(run: RecordedRun, rows: list[Row]) -> list[Plot]:
    frames = [_number(run, row) for row in rows]
    colours = {name: spec.colour for name, spec in zip(CLASS_NAMES, CLASSES, strict=True)}

    def posterior(axes: Axes) -> None:
        for name in CLASS_NAMES:
            axes.plot(frames, [row[f"p_{name}"] for row in rows], color=colours[name], label=name)
        axes.set(xlabel="frame", ylabel="probability", ylim=(0.0, 1.0))

    def motion(axes: Axes) -> None:
        for name in CLASS_NAMES[1:]:
            axes.plot(frames, [row[f"motion_{name}"] for row in rows], color=colours[name], label=name)
        axes.set(xlabel="frame", ylabel="log-likelihood")

    def points(axes: Axes) -> None:
        axes.plot(frames, [row["points"] for row in rows])
        axes.set(xlabel="frame", ylabel="points", ylim=(0.0, None))

    return [
        Plot("Posterior", "after each frame, of views, box sizes and motion", posterior),
        Plot("Motion", "of its motion, over that of background", motion),
        Plot("Points", "of its last proposal", points),
    ]


def _events(run: RecordedRun, rows: list[Row], sweeps: Mapping[int, Float32]) -> Iterator[Section]:
    """A section for each frame with a classification or a change of the state or of the class that is reported."""
    before: Row | None = None
    for row in rows:
        sentences = [*_classification(run, row), *_changes(run, row, before)]
        if sentences:
            sweep = sweeps.get(int(row["at"]))
            pictures = [] if sweep is None else crop_pictures([row[key] for key in BOX_KEYS], sweep)
            yield Section(f"Frame {_number(run, row)}", sentences, pictures=pictures)
        before = row


def _classification(run: RecordedRun, row: Row) -> Iterator[str]:
    """Sentences on the classification of a track in a frame, none where it is not classified."""
    if row["classified"]:
        posterior = ", ".join(f"{c} {100 * row[f'p_{c}']:.1f} %" for c in CLASS_NAMES)
        motion = ", ".join(f"{c} {row[f'motion_{c}']:+.1f}" for c in CLASS_NAMES[1:])
        where = f"{np.hypot(row['x'], row['y']):.0f} m away, {row['l']:.1f} × {row['w']:.1f} × {row['h']:.1f} m"
        yield f"Classified, {row['points']:g} points, {where}, {_call_mJ(run, row):.1f} mJ."
        yield f"Posterior: {posterior}."
        yield f"Motion, log-likelihood over background: {motion}."


def _changes(run: RecordedRun, row: Row, before: Row | None) -> Iterator[str]:
    """Sentences on what differs from the frame before."""
    if before is None or row["state"] != before["state"]:
        state = run.states[int(row["state"])].replace("_", " ")
        yield f"Begins as {state}." if before is None else f"Becomes {state}."
    if before is None or row["class"] != before["class"]:
        yield f"Reported as {_reported(row)}."
    if row["final"] and not (before and before["final"]):
        yield f"The class is settled: {_reported(row)}. A better view may still change it."
    if before and before["final"] and not row["final"]:
        yield "The class is open."


def _reported(row: Row) -> str:
    """The class that is reported, with its own probability; with a question mark below one half."""
    name = KIND_NAMES[int(row["class"])]
    if name not in CLASS_NAMES:
        return name.replace("_", " ")
    doubt = "?" if row["class"] and row[f"p_{name}"] < 0.5 else ""
    return f"{name}{doubt} {100 * row[f'p_{name}']:.1f} %"
