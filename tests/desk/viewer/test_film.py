"""Films are written image by image."""

import gc
import os

import numpy as np
import pytest

Image = pytest.importorskip("PIL.Image", reason="needs the extra [view]")

from modt.reporting.page import LIGHT  # noqa: E402
from modt_desk.viewer import film  # noqa: E402

N, SIZE = 20, (40, 30)
MOST_HELD = 4
"""Images: the first and the last one, each as drawn and in the colours of the film."""


def alive():
    """Images that something still holds."""
    return sum(isinstance(thing, Image.Image) for thing in gc.get_objects())


def drawing(k):
    """Paper, and a square that stays a while in each place."""
    image = Image.new("RGB", SIZE, LIGHT["paper"])
    image.paste(LIGHT["ink"], (k // 2, 5, k // 2 + 8, 15))
    return image


def images():
    """All but the first one, each asked for when those before are gone."""
    before = alive()
    for k in range(1, N):
        assert alive() <= before + MOST_HELD
        yield drawing(k)


def test_a_gif_holds_few_images_and_shows_all(tmp_path):
    film.save_gif(tmp_path / "film.gif", drawing(0), images(), 0.1)
    with Image.open(tmp_path / "film.gif") as shown:
        assert (shown.n_frames, shown.info["loop"], shown.size) == (N, 0, SIZE)
        for k in range(N):
            shown.seek(k)
            assert shown.info["duration"] == 100
            np.testing.assert_array_equal(np.asarray(shown.convert("RGB")), np.asarray(drawing(k)))


def test_an_mp4_is_piped_image_by_image(tmp_path, monkeypatch):
    encoder = tmp_path / "bin" / "ffmpeg"
    encoder.parent.mkdir()
    encoder.write_text('#!/bin/sh\nfor out; do :; done\nexec cat > "$out"\n')
    encoder.chmod(0o755)
    monkeypatch.setenv("PATH", str(encoder.parent), prepend=os.pathsep)
    film.save_mp4(tmp_path / "film.mp4", drawing(0), images(), 0.1)
    assert (tmp_path / "film.mp4").read_bytes() == b"".join(drawing(k).tobytes() for k in range(N))
