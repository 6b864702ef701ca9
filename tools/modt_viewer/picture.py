"""A frame of a run from above, x forward to the right, as a picture (SVG, PNG); frames as a film (GIF, MP4)."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterable
from datetime import datetime, timezone
from itertools import chain
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import to_rgba, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

from modt.energy.ledger import PIPELINE
from modt.errors import MisuseError, ModtError
from modt.geometry import corners
from modt.publication import KIND_NAMES
from modt.sinks.output import writing
from modt.sinks.tracks import BOX_KEYS
from modt.types import Float64, MotionState
from modt.viewer import theme
from modt.viewer.packed import SIDE, Cells
from modt.viewer.theme import LIGHT, REACH_M
from modt.viewer.track_rows import COLUMNS, SCALE
from modt_viewer.recorded_run import RINGS_M, RecordedRun, reach_m
from modt_viewer.truth_marks import LEGEND

SIZE_IN = (12.8, 9.1)
TRAIL = 30
"""Length of a trail [frames]."""
TRIES = 6
"""Heights at which a label may stand above its box."""
INK, SOFT, LINE, PAPER = (LIGHT[name] for name in ("ink", "soft", "line", "paper"))
_TEXT_PT = 9.5
_PANEL = {"facecolor": PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 0.5}
_LEAST_PT = 0.8
"""Least width of a point."""
FALSE_COLOUR = LEGEND["false"]["colour"]
_DATES_S = 1e8
"""Stamps from here on count from 1970."""
Label = tuple[float, float, str, str]


def new_figure(width: int) -> Figure:
    """An empty picture, SIZE_IN large, of a width [pixel]."""
    figure = Figure(SIZE_IN, width / SIZE_IN[0], facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def draw(
    figure: Figure, run: RecordedRun, at: int, step_cm: int, cells: Cells | None, left_out: bool = False
) -> None:
    """Draw points, tracks, truth, and the cost of the frame, in place of the former content of the figure.

    Args:
        figure: figure to draw on.
        run: recorded run.
        at: index of the frame.
        step_cm: width of a cell.
        cells: cells of the sweep, None without points.
        left_out: whether the cells of points of no proposal are coloured by their kind.
    """
    figure.clear()
    axes = figure.add_axes((0, 0, 1, 1))
    reach = reach_m(run.tracks)
    axes.set_axis_off()
    side = reach * SIZE_IN[1] / SIZE_IN[0]  # a metre is as long as along x
    axes.set(xlim=(-reach, reach), ylim=(-side, side))
    if cells is not None:
        _points(axes, cells, step_cm, theme.kinds() if left_out else [])
    rings = np.arange(RINGS_M[reach], math.hypot(*axes.viewLim.max), RINGS_M[reach]).tolist()
    for radius in rings:
        axes.add_patch(Circle((0, 0), radius, fill=False, edgecolor=LINE, zorder=0))
    (sensor,) = axes.plot(0, 0, ">", color=INK, markersize=12)
    labels = _tracks(axes, run, at) + _truth(axes, run, at)
    taken = [
        thing.get_window_extent() for thing in (_caption(axes, run, at), _legend(axes, run, at, left_out), sensor)
    ]
    labels += [(0.0, radius, f"{radius:g} m", SOFT) for radius in rings]
    _write(axes, reversed(labels), [box.transformed(axes.transData.inverted()) for box in taken])


def _points(axes: Axes, cells: Cells, step_cm: int, kinds: list[theme.Entry]) -> None:
    """Draw the cells, those of each kind in its colour."""
    x, y = ((v + 0.5 - SIDE / 2) * step_cm / 100 for v in (cells.cell % SIDE, cells.cell // SIDE))
    size = max(_LEAST_PT, 72 * SIZE_IN[0] / axes.viewLim.width * step_cm / 100)
    style = {"markersize": size, "markeredgewidth": 0, "rasterized": True, "zorder": 0.5}
    is_ground = cells.level == 0
    layers = [(LINE, is_ground)]
    layers += [(entry["colour"], ~is_ground & (cells.group == group)) for group, entry in enumerate(kinds)]
    layers += [(SOFT, ~is_ground & (cells.group >= len(kinds)))]
    for colour, shown in layers:
        axes.plot(x[shown], y[shown], "s", color=colour, **style)


class ShownTracks:
    """The M tracks of a frame as they are drawn, background first.

    Attributes:
        column: (M,) values by the names of COLUMNS.
        ids: (M,) numbers.
        kind: (M,) indices in modt.publication.KIND_NAMES.
        is_object: (M,) of another kind than background.
        is_false: (M,) objects that are reported as a wrong class.
        outline: (M, 4, 2) corners of the boxes.
        xy: (M, 2) centres of the boxes.
        class_colour, state_colour: (M, 4).
    """

    def __init__(self, run: RecordedRun, at: int) -> None:
        rows = run.tracks[run.tracks[:, COLUMNS.index("at")] == at]
        rows = rows[np.argsort(rows[:, COLUMNS.index("class")], kind="stable")]
        self.column = {name: values / SCALE.get(name, 1) for name, values in zip(COLUMNS, rows.T, strict=True)}
        self.ids = rows[:, COLUMNS.index("id")]
        self.kind = self.column["class"].astype(int)
        self.is_object = self.kind > 0
        self.is_false = self.is_object & np.isin(self.ids, run.frames[at].get("false", ()))
        self.outline = corners(np.stack([self.column[key] for key in BOX_KEYS], axis=1))
        self.xy = np.column_stack([self.column["x"], self.column["y"]])
        state = self.column["state"].astype(int)
        self.class_colour = to_rgba_array([entry["colour"] for entry in theme.classes()])[self.kind]
        self.state_colour = to_rgba_array([entry["colour"] for entry in theme.states(run.states)])[state]


def _tracks(axes: Axes, run: RecordedRun, at: int) -> list[Label]:
    """Draw boxes, rings, trails and speeds of the tracks; returns the labels of the objects."""
    tracks = ShownTracks(run, at)
    axes.add_collection(_boxes(tracks))
    axes.add_collection(_rings(axes, tracks))
    axes.add_collection(_motions(run, at, tracks))
    return _track_labels(tracks)


def _boxes(tracks: ShownTracks) -> PolyCollection:
    """Boxes filled by class and outlined by state, dashed where a track is not seen."""
    dashes = np.where(tracks.column["seen"] > 0, "-", "--").tolist()
    boxes = PolyCollection(tracks.outline, gid="tracks", linestyles=dashes)
    boxes.set_facecolor(np.column_stack([tracks.class_colour[:, :3], np.where(tracks.is_object, 0.35, 0.1)]))
    boxes.set_edgecolor(np.where(tracks.is_false[:, None], to_rgba(FALSE_COLOUR), tracks.state_colour))
    boxes.set_linewidth(np.where(tracks.is_false, 4.0, np.where(tracks.is_object, 2.0, 0.8)))
    return boxes


def _rings(axes: Axes, tracks: ShownTracks) -> EllipseCollection:
    """A ring around each track that is classified in this frame."""
    classified = tracks.column["classified"] > 0
    width = 2 * np.maximum(axes.viewLim.width / (2 * REACH_M), 0.7 * tracks.column["l"][classified])
    place = {"offsets": tracks.xy[classified], "offset_transform": axes.transData, "units": "xy"}
    return EllipseCollection(width, width, 0, facecolors="none", edgecolors=INK, gid="classified", **place)


def _motions(run: RecordedRun, at: int, tracks: ShownTracks) -> LineCollection:
    """Trails of the objects, and their ways in the next second."""
    speed_mps = tracks.column["world_speed_mps"]
    moves = tracks.is_object & (tracks.column["motion"] == MotionState.MOVING.value)
    heading = tracks.column["world_heading"] - run.poses[at, 2]
    ahead = tracks.xy + speed_mps[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    trails = [_trail(run, at, id_) for id_ in tracks.ids[tracks.is_object].tolist()]
    lines = LineCollection([*trails, *np.stack([tracks.xy, ahead], axis=1)[moves]], linewidths=1.5)
    lines.set_color(np.concatenate([tracks.class_colour[tracks.is_object], tracks.state_colour[moves]]))
    return lines


def _track_labels(tracks: ShownTracks) -> list[Label]:
    """Number, class and probability of each object, with a question mark below one half."""
    labels = []
    for k in np.flatnonzero(tracks.is_object).tolist():
        name = KIND_NAMES[tracks.kind[k]]
        probability = tracks.column.get(f"p_{name}")
        wrong = "false: " if tracks.is_false[k] else ""
        text = f"{wrong}#{tracks.ids[k]} {name}"
        if probability is not None:
            text += f"{'?' if probability[k] < 0.5 else ''} {100 * probability[k]:.0f} %"
        colour = FALSE_COLOUR if tracks.is_false[k] else INK
        labels.append((tracks.xy[k, 0], tracks.outline[k, :, 1].max(), text, colour))
    return labels


def _truth(axes: Axes, run: RecordedRun, at: int) -> list[Label]:
    """Outlines of the labelled objects; the labels of those that are missed."""
    labels = []
    for o in run.frames[at].get("truth", ()):
        (box,) = corners(np.array([[o["x"], o["y"], 0.0, o["l"], o["w"], 0.0, o["yaw"]]]))
        colour = LEGEND[o["outcome"]]["colour"]
        missed = o["outcome"] == "missed"
        axes.add_patch(Polygon(box, fill=False, edgecolor=colour, linewidth=3.0 if missed else 1.2, linestyle=":"))
        if missed:
            labels.append((o["x"], box[:, 1].max(), f"missed {theme.classes()[o['class']]['name']}", colour))
    return labels


def _trail(run: RecordedRun, at: int, id_: int) -> Float64:
    """(n, 2) past positions of a track, as seen from the sensor now."""
    now = run.tracks[:, COLUMNS.index("at")]
    world = COLUMNS.index("world_x")
    rows = run.tracks[(run.tracks[:, 0] == id_) & (now <= at) & (now >= at - TRAIL)]
    x, y, yaw = run.poses[at]
    c, s = np.cos(yaw), np.sin(yaw)
    return np.asarray((rows[:, world : world + 2] / SCALE["world_x"] - [x, y]) @ np.array([[c, -s], [s, c]]))


def _caption(axes: Axes, run: RecordedRun, at: int) -> Text:
    """Facts of the frame and its cost."""
    frame = run.frames[at]
    facts = [f"frame {frame['frame']}, {_time(frame['stamp_s'])}, mode {run.facts['mode']}"]
    facts.append(f"{frame['proposals']} proposals, budget {run.budget}")
    facts.append(f"{frame['classifications']} classified, {frame['deferred']} deferred")
    if "cpu_ms" in frame:
        cpu_ms = sum(frame["cpu_ms"].get(name, 0.0) for name in PIPELINE)
        facts.append(f"pipeline: {cpu_ms:.1f} ms of CPU time")
    if "energy_mJ" in frame:
        facts.append(f"pipeline {frame['pipeline_mJ']:.1f} mJ, process {frame['energy_mJ']:.0f} mJ ({frame['kind']})")
    style = {"va": "top", "color": INK, "fontsize": _TEXT_PT, "linespacing": 1.5, "bbox": _PANEL}
    return axes.text(0.01, 0.985, "\n".join(facts), transform=axes.transAxes, **style)


def _legend(axes: Axes, run: RecordedRun, at: int, left_out: bool) -> Legend:
    """Colours of the classes and the states, of kinds of points, and of outcomes where the frame has truth."""
    outlines = theme.states(run.states) + (list(LEGEND.values()) if "truth" in run.frames[at] else [])
    filled = theme.classes() + (theme.kinds() if left_out else [])
    entries = [(entry, True) for entry in filled] + [(entry, False) for entry in outlines]
    patches = [Patch(fill=f, color=e["colour"], linewidth=2, label=e["name"].replace("_", " ")) for e, f in entries]
    style = {"facecolor": PAPER, "edgecolor": "none", "labelcolor": SOFT, "fontsize": _TEXT_PT}
    return axes.legend(handles=patches, loc="lower left", handlelength=1, handleheight=1, **style)


def _write(axes: Axes, labels: Iterable[Label], taken: list[Bbox]) -> None:
    """Write each label above its point, or further up with a line to it; one without room is left out."""
    view = axes.viewLim
    for x, y, text, colour in labels:
        if not view.contains(x, y):
            continue
        style = {"ha": "center", "va": "bottom", "color": colour, "fontsize": _TEXT_PT, "bbox": _PANEL}
        label = axes.text(x, y, text, **style)
        box = label.get_window_extent().transformed(axes.transData.inverted())
        inward = max(view.x0 - box.x0, 0.0) + min(view.x1 - box.x1, 0.0)
        tried = [box.translated(inward, k * box.height) for k in range(TRIES)]
        place = next((place for place in tried if not place.count_overlaps(taken)), None)
        if place is None:
            label.remove()
            continue
        taken.append(place)
        label.set_position((x + inward, place.y0))
        if place is not tried[0]:
            axes.plot([x, x], [y, place.y0], color=SOFT, linewidth=0.8)


def _time(stamp_s: float) -> str:
    """Seconds since the start of a recording, or a date."""
    if stamp_s < _DATES_S:
        return f"{stamp_s:.2f} s"
    return f"{datetime.fromtimestamp(stamp_s, timezone.utc):%Y-%m-%d %H:%M:%S.%f}"[:-4]


SHARP_DPI = 200
"""Resolution of the points in an SVG [pixel/inch]."""
_REPEATABLE = {"svg.fonttype": "none", "svg.hashsalt": "modt"}
"""Text stays text, and the same picture is the same bytes."""


def save_picture(path: Path, figure: Figure, title: str) -> None:
    """Write a figure as SVG or PNG.

    Raises:
        ModtError: it cannot be written.
    """
    dpi = SHARP_DPI if path.suffix == ".svg" else figure.dpi
    with writing(path), mpl.rc_context(_REPEATABLE):
        figure.savefig(path, dpi=dpi, metadata={"Title": title, "Date": None})


def save_film(path: Path, figure: Figure, drawings: Iterable[Figure], period_s: float) -> None:
    """Write a figure as it is now and as each drawing leaves it, one after the other, as GIF or MP4.

    Raises:
        MisuseError: ffmpeg, for MP4, is not installed.
        ModtError: it cannot be written.
    """
    save = _save_mp4 if path.suffix == ".mp4" else _save_gif
    with writing(path):
        save(path, figure, drawings, period_s)


def _save_gif(path: Path, figure: Figure, drawings: Iterable[Figure], period_s: float) -> None:
    palette = _image(figure).quantize(method=Image.Quantize.MAXCOVERAGE)
    images = (_image(f).quantize(palette=palette, dither=Image.Dither.NONE) for f in chain([figure], drawings))
    next(images).save(path, save_all=True, append_images=images, duration=round(1e3 * period_s), loop=0)


def _save_mp4(path: Path, figure: Figure, drawings: Iterable[Figure], period_s: float) -> None:
    if not FFMpegWriter.isAvailable():
        raise MisuseError(path, "needs ffmpeg", "install it, or give a name that ends with .gif")
    writer = FFMpegWriter(fps=1 / period_s)
    try:
        with writer.saving(figure, path, figure.dpi):
            for _ in chain([figure], drawings):
                writer.grab_frame()
    except subprocess.CalledProcessError as error:
        raise ModtError(
            path, f"cannot be written by ffmpeg ({error.stderr[-200:].strip()})", "free or unlock the disk"
        ) from None


def _image(figure: Figure) -> Image.Image:
    figure.canvas.draw()
    return Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
