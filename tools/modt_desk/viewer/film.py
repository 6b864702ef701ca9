"""Frames of a run as a picture (SVG, PNG) or one after the other as a film (GIF, MP4)."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.figure import Figure
from PIL import Image

from modt.errors import MisuseError, ModtError
from modt.sinks.output import writing

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
