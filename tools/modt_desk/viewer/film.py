"""Pictures one after the other, as GIF or, where ffmpeg is installed, MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np
from PIL import Image

from modt.errors import MisuseError, ModtError
from modt.reporting.page import LIGHT
from modt.sinks.output import writing
from modt.viewer import look
from modt_desk.viewer.gif import COLOURS, write_gif

_MIXED = (1.0, 0.75, 0.5, 0.35, 0.2, 0.1)
"""Parts of a colour over paper: edges, and what shines through."""
_APART = 8
"""Least difference to paper of an entry of the palette, for Pillow takes colours that are nearer for each other."""


@cache
def _palette() -> Image.Image:
    """The colours that pictures are drawn in; one found in the picture would lose what is small."""
    entries = [*look.classes(), *look.truth().values(), *look.states(look.STATES)]
    drawn = dict.fromkeys([*LIGHT.values(), *(entry["colour"] for entry in entries)])
    colours = np.array([list(bytes.fromhex(colour[1:])) for colour in drawn])
    paper = np.array(list(bytes.fromhex(LIGHT["paper"][1:])))
    mixed = np.concatenate([np.rint(paper + part * (colours - paper)) for part in _MIXED])
    told_apart = mixed[np.abs(mixed - paper).max(axis=1) >= _APART]
    image = Image.new("P", (1, 1))
    image.putpalette(np.concatenate([[paper], told_apart])[:COLOURS].astype(np.uint8).tobytes())
    return image


def few_colours(image: Image.Image) -> Image.Image:
    """The picture in the colours of its palette, for a small file."""
    return image.quantize(palette=_palette(), dither=Image.Dither.NONE)


def save_gif(path: Path, first: Image.Image, rest: Iterator[Image.Image], period_s: float) -> None:
    """Write images that follow one another after a period, again and again.

    Raises:
        ModtError: it cannot be written.
    """
    with writing(path), path.open("wb") as file:
        write_gif(file, map(few_colours, chain([first], rest)), period_s)


def save_mp4(path: Path, first: Image.Image, rest: Iterator[Image.Image], period_s: float) -> None:
    """Write images that follow one another after a period.

    Raises:
        MisuseError: ffmpeg is not installed.
        ModtError: it cannot be written.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        raise MisuseError(path, "needs ffmpeg", "install it, or give a name that ends with .gif")
    size, rate = f"{first.width}x{first.height}", f"{1 / period_s:.4f}"
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate, "-i", "-"]
    command = [program, "-v", "error", "-y", *source, "-pix_fmt", "yuv420p", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            process.stdin.write(first.tobytes())
            for image in rest:
                process.stdin.write(image.tobytes())
            process.stdin.close()
        except BrokenPipeError:  # what it says is more useful
            pass
        said = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise ModtError(path, f"cannot be written by ffmpeg ({said[-200:]})", "free or unlock the disk")
