"""Output formats of `modt view` by the ending of the file's name."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from modt.errors import MisuseError, install

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from modt.sources.stream import Stream
    from modt.viewer.point_cells import Cells
    from modt_desk.viewer.recorded_run import RecordedRun
    from modt_desk.viewer.sweeps import Grid

PLAYER, PICTURE, PIXELS, GIF, MP4 = ".html", ".svg", ".png", ".gif", ".mp4"
PICTURE_WIDTH, FILM_WIDTH = 1280, 960
"""Widths of pictures and films [pixel]."""


@dataclass(frozen=True, slots=True)
class View:
    """The frames to show and the file to write."""

    run: RecordedRun
    at: int  # index of the frame, or of the first
    stream: Stream | None
    grid: Grid
    out: Path

    def cells(self, numbers: Sequence[int], most: int) -> Iterator[Cells] | None:
        """Cells of the frames, None without points."""
        from modt_desk.viewer.sweeps import sweeps

        return None if self.stream is None else sweeps(numbers, self.stream, self.grid, most)

    def drawings(self, width: int, n: int | None = None) -> Iterator[Figure]:
        """One figure, drawn anew for each frame from the first one on.

        Raises:
            MisuseError: Matplotlib or Pillow is not installed.
        """
        try:
            from modt_desk.viewer.picture import draw, new_figure
        except ModuleNotFoundError as error:
            raise MisuseError(self.out, f"needs {error.name}", install("view")) from None
        figure, numbers = new_figure(width), self.run.numbers[self.at :][:n]
        cells = self.cells(numbers, sys.maxsize)
        for at in range(self.at, self.at + len(numbers)):
            draw(figure, self.run, at, self.grid.step_cm, None if cells is None else next(cells))
            yield figure

    @property
    def period_s(self) -> float:
        """Mean time between two frames."""
        stamps: list[float] = [frame["stamp_s"] for frame in self.run.frames]
        return max((stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1), 0.02)


def _player(view: View) -> None:
    from modt_desk.viewer.player import most_cells, save_player

    numbers = view.run.numbers
    save_player(view.out, view.run, view.at, view.grid.step_cm, view.cells(numbers, most_cells(len(numbers))))


def _picture(view: View) -> None:
    figure = next(view.drawings(PICTURE_WIDTH, 1))  # names a missing library before the next module needs it
    from modt_desk.viewer.film import save_picture

    save_picture(view.out, figure, f"{view.run.facts['stream']['name']}, frame {view.run.numbers[view.at]}")


def _film(view: View) -> None:
    drawings = view.drawings(FILM_WIDTH)
    first = next(drawings)
    from modt_desk.viewer.film import save_film

    save_film(view.out, first, drawings, view.period_s)


FORMS = {PLAYER: _player, PICTURE: _picture, PIXELS: _picture, GIF: _film, MP4: _film}
