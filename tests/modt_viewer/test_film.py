"""Films of a run."""

import os

import numpy as np
import pytest

Image = pytest.importorskip("PIL.Image", reason="needs the extra [view]")
pytest.importorskip("matplotlib", reason="needs the extra [view]")

from modt.errors import ModtError  # noqa: E402
from modt_viewer import picture  # noqa: E402

N = 5
WIDTH = 128
SIZE = (128, 91)
BLUE = (0, 0, 255)


def drawings(figure):
    """A square that stays where it is for two frames."""
    for k in range(N):
        figure.clear()
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.plot((0.2 + 0.1 * (k // 2),), (0.5,), "s", color="blue", markersize=90)
        axes.set(xlim=(0, 1), ylim=(0, 1))
        yield figure


def left_edge(image):
    """Column where the square begins."""
    return np.flatnonzero((np.asarray(image.convert("RGB")) == BLUE).all(axis=2).any(axis=0))[0]


def film_of(path):
    figure = picture.new_figure(WIDTH)
    rest = drawings(figure)
    picture.save_film(path, next(rest), rest, 0.1)


def test_a_gif_shows_every_drawing_as_long_as_it_stays(tmp_path):
    film_of(tmp_path / "film.gif")
    with Image.open(tmp_path / "film.gif") as shown:
        assert (shown.n_frames, shown.info["loop"], shown.size) == (3, 0, SIZE)
        seen = []
        for k in range(shown.n_frames):
            shown.seek(k)
            seen.append((shown.info["duration"], left_edge(shown)))
    durations, edges = zip(*seen, strict=True)
    assert durations == (200, 200, 100)
    assert np.all(np.diff(edges) > 0.08 * WIDTH)


def test_the_message_of_ffmpeg_is_the_error(tmp_path, monkeypatch):
    encoder = tmp_path / "ffmpeg"
    encoder.write_text("#!/bin/sh\necho no room >&2; exit 1\n")
    encoder.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(ModtError, match=r"cannot be written by ffmpeg \(no room\)"):
        film_of(tmp_path / "film.mp4")
