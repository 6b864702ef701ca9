"""What `modt view` writes, by the ending of the file's name."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from modt.errors import MisuseError

if TYPE_CHECKING:
    from PIL import Image

    from modt.sources.stream import Stream
    from modt.viewer.point_cells import Cells, Grid
    from modt_desk.viewer.recorded_run import RecordedRun

PLAYER, PICTURE, PIXELS, GIF, MP4 = ".html", ".svg", ".png", ".gif", ".mp4"
PICTURE_WIDTH, FILM_WIDTH = 1280, 960
"""Pixels."""


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
        from modt_desk.viewer.sweeps import sweeps

        return None if self.stream is None else sweeps(numbers, self.stream, self.grid, most)

    def images(self, width: int, n: int | None = None) -> Iterator[Image.Image]:
        """Of the frames from the first one on.

        Raises:
            MisuseError: Pillow is not installed.
        """
        try:
            from modt_desk.viewer.pixel_canvas import PixelCanvas
        except ModuleNotFoundError as error:
            raise MisuseError(self.out, f"needs {error.name}", "pip install 'modt[view]'") from None
        from modt_desk.viewer.picture import draw

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
    from modt_desk.viewer.player import most_cells, save_player

    numbers = view.run.numbers
    save_player(view.out, view.run, view.at, view.grid.step_cm, view.cells(numbers, most_cells(len(numbers))))


def _svg(view: View) -> None:
    from modt.reporting.page import save
    from modt_desk.viewer.picture import MOST_CELLS, draw
    from modt_desk.viewer.svg_canvas import SvgCanvas

    canvas, number = SvgCanvas(), view.run.numbers[view.at]
    cells = view.cells([number], MOST_CELLS)
    draw(canvas, view.run, view.at, view.grid.step_cm, None if cells is None else next(cells))
    save(view.out, canvas.document(f"{view.run.facts['stream']['name']}, frame {number}"))


def _png(view: View) -> None:
    from modt.sinks.output import writing

    image = next(view.images(PICTURE_WIDTH, 1))
    from modt_desk.viewer.film import few_colours

    with writing(view.out):
        few_colours(image).save(view.out, optimize=True)


def _gif(view: View) -> None:
    images = view.images(FILM_WIDTH)
    first = next(images)  # says that Pillow is missing before the module that needs it is imported
    from modt_desk.viewer.film import save_gif

    save_gif(view.out, first, images, view.period_s)


def _mp4(view: View) -> None:
    images = view.images(FILM_WIDTH)
    first = next(images)
    from modt_desk.viewer.film import save_mp4

    save_mp4(view.out, first, images, view.period_s)


FORMS = {PLAYER: _player, PICTURE: _svg, PIXELS: _png, GIF: _gif, MP4: _mp4}
