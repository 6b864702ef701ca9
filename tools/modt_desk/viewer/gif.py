"""A GIF that is written image by image."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import GifImagePlugin, Image

COLOURS = 255
"""Of the images; the last index stands for what stays as it was."""
_SAME = COLOURS
_KEEP = 1
"""Disposal of an image: the next one is drawn over it."""
_FOR_EVER = b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"


def write_gif(file: BinaryIO, images: Iterable[Image.Image], period_s: float) -> None:
    """Show images one after another, again and again; no more than two are held.

    Args:
        file: written to.
        images: of one size and palette, with at most COLOURS colours.
        period_s: between two of them.

    Raises:
        OSError: it cannot be written.
    """
    shown: NDArray[np.uint8] | None = None
    for image in images:
        pixels = np.asarray(image)
        if shown is None:
            file.write(_header(image))
            part, box = image, (0, 0)
        else:
            part, box = _changed(shown, pixels)
        options = {"duration": round(1e3 * period_s), "disposal": _KEEP, "transparency": _SAME}
        file.writelines(GifImagePlugin.getdata(part, box, **options))
        shown = pixels
    file.write(b";")


def _header(image: Image.Image) -> bytes:
    palette = bytes(image.getpalette() or ())[: 3 * COLOURS]
    return b"GIF89a" + struct.pack("<HH3B", *image.size, 0xF7, 0, 0) + palette.ljust(3 * 256, b"\0") + _FOR_EVER


def _changed(before: NDArray[np.uint8], now: NDArray[np.uint8]) -> tuple[Image.Image, tuple[int, int]]:
    """The part of an image that holds all that has changed, and its left upper corner; a pixel where nothing has."""
    differs = before != now
    rows, columns = (np.flatnonzero(differs.any(axis=axis)) for axis in (1, 0))
    top, bottom, left, right = (*rows[[0, -1]], *columns[[0, -1]]) if len(rows) else (0, 0, 0, 0)
    changed = np.where(differs, now, np.uint8(_SAME))[top : bottom + 1, left : right + 1]
    return Image.frombytes("P", changed.shape[::-1], changed.tobytes()), (int(left), int(top))
