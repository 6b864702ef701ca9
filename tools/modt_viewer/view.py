"""A recorded run from above: a page that plays it without a network, a picture of a frame, a film, a track's page."""

from __future__ import annotations

import json
import math
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from modt.app import assembly, inputs
from modt.config import ProfileConfig
from modt.errors import MisuseError, ModtError
from modt.geometry import FieldOfView
from modt.segmentation.grids import PointColumns
from modt.segmentation.segmenter import Segmenter
from modt.sinks.output import writing
from modt.sources.stream import Stream
from modt.types import Float32, Int8, PointKind
from modt.viewer import theme
from modt.viewer.html_page import content, page
from modt.viewer.packed import LEVEL_M, LEVELS, SIDE, Cells, group_of, occupied, packed_cells, packed_table
from modt_evaluation.run_record import FramesByNumber
from modt_evaluation.truth import by_stamp
from modt_evaluation.truth_files import labels_beside, open_truth
from modt_profiling.reporting.view_extra import importing, save
from modt_viewer.recorded_run import RecordedRun, reach_m
from modt_viewer.track_page import rows_of, track_page, views
from modt_viewer.truth_marks import LEGEND, truth_marks

NO_CELLS = Cells(*np.zeros((3, 0), np.int64))
STEP_CM = 4
"""Least width of a cell [cm]."""


class Grid:
    """Converts sweeps to cells. A record does not hold the kinds of the points, so each sweep is segmented anew."""

    def __init__(self, config: ProfileConfig, fov: FieldOfView = FieldOfView()) -> None:
        self._segmenter = Segmenter(config.segmentation, config.sensor, FieldOfView())  # for the height of the points
        self._stage = assembly.segmenter(config, fov, assembly.chosen_kernels(config.segmentation.kernels))
        self._clearance_m = config.segmentation.clearance_m
        self._range_m = config.sensor.max_range_m
        self.step_cm = max(STEP_CM, math.ceil(200 * self._range_m / SIDE))

    def cells(self, points: Float32) -> Cells:
        """Cells of (N, 4) points; those beyond the range of the sensor count as none."""
        sweep = PointColumns.from_array(points)
        height = self._segmenter.ground.height_above(sweep, self._segmenter.sensor_height_m(points))
        sweep_range = sweep.sqrt_range**2
        used = (sweep_range > 0) & (sweep_range < self._range_m)
        kind = self._kinds(points)[used]
        height = height[used]
        level = np.clip(np.rint(height / LEVEL_M), 1, LEVELS - 1).astype(np.int64)
        is_outside = (kind == PointKind.OUT_OF_RANGE) | (kind == PointKind.OUT_OF_VIEW)
        level[(kind == PointKind.GROUND) | (is_outside & (height <= self._clearance_m))] = 0
        return occupied(sweep.x[used], sweep.y[used], level, group_of(kind), self.step_cm)

    def _kinds(self, points: Float32) -> Int8:
        """(N,) kinds of the points."""
        kind = self._stage.segment(points).kind
        assert kind is not None
        return kind


SCRIPT = Path(__file__).parent / "recorded.js"
POINT_BYTES = 20_000_000
"""Approximate size of the points of a page [bytes]; the sweeps of a long run have fewer cells each."""
CELL_BYTES = 1.5
"""Size of a cell, compressed and in base64."""


def _rounded(value: Any) -> Any:
    """Plain data whose numbers have three decimals, which keeps a page small."""
    return json.loads(json.dumps(value), parse_float=lambda digits: round(float(digits), 3))


def _data(name: str, text: str) -> str:
    return f'<script type="text/plain" id="{name}">{text}</script>\n'


if TYPE_CHECKING:  # Matplotlib is an extra
    from matplotlib.figure import Figure

Capture = Sequence[tuple[str, str]]
PICTURE_WIDTH = 1280
"""Width of a picture [pixel]."""
FILM_WIDTH = 960
"""Width of a film [pixel]."""


@dataclass(frozen=True)
class View:
    """The frames to show and the file to write."""

    run: RecordedRun
    at: int  # index of the frame, or of the first
    stream: Stream | None
    grid: Grid
    left_out: bool  # whether the points of no proposal are coloured by their kind
    out: Path

    def cells(self, numbers: Sequence[int], most: int = sys.maxsize) -> Iterator[Cells] | None:
        """Cells of each frame, by ascending number, at most so many; none of a frame that the stream does not hold.

        None without points.
        """
        if self.stream is None:
            return None
        frames = map(FramesByNumber(self.stream.between(0, numbers[-1] + 1)).get, numbers)
        return (NO_CELLS if frame is None else self.grid.cells(frame.points).thinned(most) for frame in frames)

    def drawings(self, width: int, n: int | None = None) -> Iterator[Figure]:
        """One figure, drawn anew for each frame from the first one on.

        Raises:
            MisuseError: Matplotlib or Pillow is not installed.
        """
        with importing(self.out):
            from modt_viewer.picture import draw, new_figure
        figure = new_figure(width)
        numbers = self.run.numbers[self.at :][:n]
        cells = self.cells(numbers)
        for at in range(self.at, self.at + len(numbers)):
            shown = None if cells is None else next(cells)
            draw(figure, self.run, at, self.grid.step_cm, shown, self.left_out)
            yield figure

    @property
    def period_s(self) -> float:
        """Mean time between two frames."""
        stamps: list[float] = [frame["stamp_s"] for frame in self.run.frames]
        return max((stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1), 0.02)


def _player(view: View) -> None:
    """Write the page of a run, which opens at a frame."""
    run = view.run
    poses = view.run.poses.round(4).tolist()
    cells = view.cells(run.numbers, int(POINT_BYTES / CELL_BYTES / len(poses)))
    about = f"mode {run.facts['mode']}, field of view {run.facts.get('fov', 'full')}, profile {run.sensor}"
    if cells is None:
        about += "; the source of its points is not found"
    known = content(theme.states(run.states), run.budget, None if cells is None else view.grid.step_cm) | {
        "frames": [_rounded(f | {"pose": pose}) for f, pose in zip(run.frames, poses, strict=True)],
        "truth": LEGEND if any("truth" in frame for frame in run.frames) else None,
        "reach_m": reach_m(run.tracks),
        "start": view.at,
        "left_out": view.left_out,
    }
    head, tail = page(run.facts["stream"]["name"], about, known, SCRIPT)
    with writing(view.out), view.out.open("w", encoding="utf-8") as file:
        file.write(head)
        file.write(_data("tracks", packed_table(run.tracks)))
        for at, sweep in enumerate(cells or ()):
            file.write(_data(f"points-{at}", packed_cells(sweep)))
        file.write(tail)


def _picture(view: View) -> None:
    figure = next(view.drawings(PICTURE_WIDTH, 1))  # names a missing library
    from modt_viewer.picture import save_picture

    save_picture(view.out, figure, f"{view.run.facts['stream']['name']}, frame {view.run.numbers[view.at]}")


def _film(view: View) -> None:
    drawings = view.drawings(FILM_WIDTH)
    first = next(drawings)
    from modt_viewer.picture import save_film

    save_film(view.out, first, drawings, view.period_s)


FORMS = {".html": _player, ".svg": _picture, ".png": _picture, ".gif": _film, ".mp4": _film}
"""Writer of a file by its suffix."""


def save_view(
    directory: Path, frame: int | None, labels: Path | None, capture: Capture, out: Path, *, left_out: bool = False
) -> None:
    """Write the page, the picture or the film of a run, by the ending of the file's name.

    With `left_out` the points of no proposal are coloured by their kind; a page has a key for it.

    Raises:
        MisuseError: no run, a frame that is not recorded, a file of another kind, or a missing extra.
        ModtError: the file cannot be written.
    """
    if out.suffix not in FORMS:
        raise MisuseError(out, "no kind of picture", f"give a name that ends with {', '.join(FORMS)}")
    recorded = RecordedRun.read(directory)
    write = FORMS[out.suffix]
    first = 0 if write is _film else recorded.first_object
    at = first if frame is None else recorded.position(frame)
    stream = mark_truth(recorded, labels, source(recorded, capture))
    if stream is None and recorded.record.live:
        print("modt: without points: a live source cannot be read again; --truth may have scans", file=sys.stderr)
    fov = FieldOfView()
    if stream is not None and stream.info.camera is not None:
        fov = inputs.field_of_view(inputs.Request(fov=recorded.facts.get("fov", "full")), stream.info)
    write(View(recorded, at, stream, Grid(recorded.config, fov), left_out, out))


def save_track_page(directory: Path, track: int, capture: Capture, out: Path) -> None:
    """Write the page of a track.

    Raises:
        MisuseError: no run, or no such track.
        ModtError: the file cannot be written.
    """
    recorded = RecordedRun.read(directory)
    rows = rows_of(recorded, track)
    save(out, track_page(recorded, rows, views(recorded, rows, source(recorded, capture))))


def default_name(frame: int | None, animate: bool) -> str:
    """Default name of the file."""
    if animate:
        return "view.mp4" if shutil.which("ffmpeg") else "view.gif"
    return "view.html" if frame is None else f"view-{frame}.svg"


def mark_truth(recorded: RecordedRun, labels: Path | None, stream: Stream | None) -> Stream | None:
    """Mark the frames with their truth, by the given labels or those beside the source of the run.

    Returns:
        the stream, of a live run the scans of its truth.

    Raises:
        MisuseError: labels are given that cannot be used.
    """
    run = recorded.record
    try:
        found = labels or (labels_beside(run.stream) if run.stream else None)
        if found is None:
            return stream
        truth = open_truth(found, run.stream)
        if run.live:
            truth = by_stamp(truth, {frame["frame"]: frame["stamp_s"] for frame in recorded.frames})
            stream = truth.scans
        marks = truth_marks(run, truth, stream)
    except ModtError as error:
        if labels is not None:
            raise
        print(f"modt: without truth: {error}", file=sys.stderr)
        return stream
    for frame in recorded.frames:
        frame.update(marks.get(frame["frame"], {}))
    return stream


def source(recorded: RecordedRun, capture: Capture) -> Stream | None:
    """The stream of a run, None if it was live or cannot be found."""
    try:
        stream = recorded.record.source(capture)
    except ModtError as error:
        print(f"modt: without points: {error}", file=sys.stderr)
        return None
    name = recorded.facts["stream"]["name"]
    if stream is None or stream.info.name == name:
        return stream
    print(f"modt: without points: {name} cannot be read again", file=sys.stderr)
    return None
