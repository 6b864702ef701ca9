"""`modt view`: a recorded run from above, as a page that plays it, a picture of a frame, or a film."""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from modt.cli import options
from modt.errors import MisuseError, ModtError

if TYPE_CHECKING:
    from PIL import Image

    from modt.sources.stream import Stream
    from modt.viewer.point_cells import Cells, Grid
    from modt.viewer.recorded_run import RecordedRun

PLAYER, PICTURE, PIXELS, GIF, MP4 = ".html", ".svg", ".png", ".gif", ".mp4"
PICTURE_WIDTH, FILM_WIDTH = 1280, 960
"""Pixels."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("view", help="show a recorded run from above, with the points of its source")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory written by modt replay or modt run")
    which = p.add_mutually_exclusive_group()
    frame = "draw one frame, or begin a page or a film there"
    which.add_argument("--frame", type=options.integer(0, 10**9, "the number of a frame"), metavar="N", help=frame)
    film = "make a film, RUN/view.mp4, or RUN/view.gif where ffmpeg is not installed"
    which.add_argument("--animate", action="store_true", help=film)
    track = "tell how the class of a track was decided (default: RUN/track-ID.html)"
    which.add_argument("--track", type=options.integer(0, 10**9, "the number of a track"), metavar="ID", help=track)
    out = (
        "FILE.html, a page that plays the run (default: RUN/view.html); of one frame FILE.svg (with --frame: "
        "RUN/view-N.svg) or FILE.png; a film, FILE.gif or FILE.mp4"
    )
    options.add_capture_option(p)
    truth = "labels to compare with, as for modt evaluate (default: those that lie with its source)"
    p.add_argument("--truth", type=Path, metavar="TRUTH", help=truth)
    p.add_argument("--out", type=Path, metavar="FILE", help=out)
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Write the page, the picture or the film.

    Raises:
        MisuseError: no run, a frame that is not recorded, a file of another kind, or a missing extra.
        ModtError: the file cannot be written.
    """
    from modt.viewer.point_cells import Grid
    from modt.viewer.recorded_run import RecordedRun

    directory = arguments.run_directory
    if arguments.track is not None:
        return tell(arguments)
    out: Path = arguments.out or directory / default_name(arguments.frame, arguments.animate)
    if out.suffix not in FORMS:
        raise MisuseError(out, "no kind of picture", f"give a name that ends with {', '.join(FORMS)}")
    recorded = RecordedRun.read(directory)
    at = 0 if arguments.frame is None else recorded.position(arguments.frame)
    mark_truth(recorded, directory, arguments.truth)
    FORMS[out.suffix](View(recorded, at, source(recorded, arguments.capture), Grid(recorded.config), out))
    print(f"{out} ({out.stat().st_size / 1e6:.1f} MB)")
    return 0


def tell(arguments: argparse.Namespace) -> int:
    """Write the page of a track.

    Raises:
        MisuseError: no run, or no such track.
        ModtError: the file cannot be written.
    """
    from modt.reporting.page import save
    from modt.viewer.recorded_run import RecordedRun
    from modt.viewer.track_page import track_page, track_rows, views

    directory, out = arguments.run_directory, arguments.out
    recorded = RecordedRun.read(directory)
    rows = track_rows(recorded, arguments.track)
    out = out or directory / f"track-{arguments.track}{PLAYER}"
    save(out, track_page(recorded, rows, views(recorded, rows, source(recorded, arguments.capture))))
    print(out)
    return 0


def default_name(frame: int | None, animate: bool) -> str:
    """Of the file, where none is given."""
    if animate:
        return f"view{MP4 if shutil.which('ffmpeg') else GIF}"
    return f"view{PLAYER}" if frame is None else f"view-{frame}{PICTURE}"


@dataclass(frozen=True, slots=True)
class View:
    """What is to be shown, and where."""

    run: RecordedRun
    at: int  # index of the frame, or of the first
    stream: Stream | None
    grid: Grid
    out: Path

    def cells(self, numbers: Sequence[int], most: int) -> Iterator[Cells] | None:
        """Those of the frames, None without points."""
        from modt.viewer.sweeps import sweeps

        return None if self.stream is None else sweeps(numbers, self.stream, self.grid, most)

    def images(self, width: int, n: int | None = None) -> Iterator[Image.Image]:
        """Of the frames from the first one on.

        Raises:
            MisuseError: Pillow is not installed.
        """
        try:
            from modt.viewer.pixel_canvas import PixelCanvas
        except ModuleNotFoundError as error:
            raise MisuseError(self.out, f"needs {error.name}", "pip install 'modt[view]'") from None
        from modt.viewer.picture import draw

        numbers = self.run.numbers[self.at :][:n]
        cells = self.cells(numbers, sys.maxsize)
        for at in range(self.at, self.at + len(numbers)):
            canvas = PixelCanvas(width)
            draw(canvas, self.run, at, self.grid.step_cm, None if cells is None else next(cells))
            yield canvas.image()

    @property
    def period_s(self) -> float:
        """Between two frames."""
        stamps: list[float] = [frame["stamp_s"] for frame in self.run.frames]
        return max((stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1), 0.02)


def _player(view: View) -> None:
    from modt.viewer.player import most_cells, save_player

    numbers = view.run.numbers
    save_player(view.out, view.run, view.at, view.grid.step_cm, view.cells(numbers, most_cells(len(numbers))))


def _svg(view: View) -> None:
    from modt.reporting.page import save
    from modt.viewer.picture import MOST_CELLS, draw
    from modt.viewer.svg_canvas import SvgCanvas

    canvas, number = SvgCanvas(), view.run.numbers[view.at]
    cells = view.cells([number], MOST_CELLS)
    draw(canvas, view.run, view.at, view.grid.step_cm, None if cells is None else next(cells))
    save(view.out, canvas.document(f"{view.run.facts['stream']['name']}, frame {number}"))


def _png(view: View) -> None:
    from modt.sinks.output import writing

    image = next(view.images(PICTURE_WIDTH, 1))
    from modt.viewer.film import few_colours

    with writing(view.out):
        few_colours(image).save(view.out, optimize=True)


def _gif(view: View) -> None:
    images = view.images(FILM_WIDTH)
    first = next(images)  # says that Pillow is missing before the module that needs it is imported
    from modt.viewer.film import save_gif

    save_gif(view.out, first, images, view.period_s)


def _mp4(view: View) -> None:
    images = view.images(FILM_WIDTH)
    first = next(images)
    from modt.viewer.film import save_mp4

    save_mp4(view.out, first, images, view.period_s)


FORMS = {PLAYER: _player, PICTURE: _svg, PIXELS: _png, GIF: _gif, MP4: _mp4}


def mark_truth(recorded: RecordedRun, directory: Path, labels: Path | None) -> None:
    """Add to the frames what is true of them, by labels or by those that lie with the source of the run.

    Raises:
        MisuseError: labels are given that cannot be used.
    """
    from modt.evaluation.run_record import RunRecord
    from modt.evaluation.truth_files import labels_beside, open_truth
    from modt.viewer.truth_marks import truth_marks

    try:
        run = RunRecord.open(directory)
        found = labels or (labels_beside(run.stream) if run.stream else None)
        marks = {} if found is None else truth_marks(run, open_truth(found, run.stream))
    except ModtError as error:
        if labels is not None:
            raise
        print(f"modt: without truth: {error}", file=sys.stderr)
        return
    for frame in recorded.frames:
        frame.update(marks.get(frame["frame"], {}))


def source(recorded: RecordedRun, capture: Sequence[tuple[str, str]]) -> Stream | None:
    """The stream that a run was made of, None where it is not found any more."""
    from modt.cli import assemble

    facts = recorded.facts["stream"]
    try:
        path = Path(facts["path"]) if facts["path"] else None
        stream = assemble.stream(assemble.Request(path=path, capture=capture))
    except ModtError as error:
        print(f"modt: without points: {error}", file=sys.stderr)
        return None
    if stream.info.name == facts["name"]:
        return stream
    print(f"modt: without points: {facts['name']} cannot be read again", file=sys.stderr)
    return None
