"""Pictures one after the other, as GIF or, where ffmpeg is installed, MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from modt.errors import MisuseError, ModtError
from modt.sinks.output import writing

COLOURS = 64
"""Of a GIF."""


def save_gif(path: Path, first: Image.Image, rest: Iterator[Image.Image], period_s: float) -> None:
    """Write images that follow one another after a period, again and again.

    Raises:
        ModtError: it cannot be written.
    """
    palette = first.quantize(COLOURS)
    others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in rest)
    with writing(path):
        palette.save(
            path, save_all=True, append_images=others, duration=round(1e3 * period_s), loop=0, optimize=False
        )


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
