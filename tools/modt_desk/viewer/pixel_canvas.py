"""A picture as pixels, drawn by Pillow."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from modt.reporting.page import LIGHT
from modt.types import Float64
from modt.viewer.look import REACH_M
from modt_desk.viewer.canvas import SIDE_M, TEXT_M

SHARP = 2
"""Pixels drawn along each side of one that is shown."""


class PixelCanvas:
    """Shapes on an image of a width [pixel]; the height is even, as films want it."""

    def __init__(self, width: int) -> None:
        self._metre = SHARP * width / (2 * REACH_M)
        size = SHARP * width, SHARP * (int(width * SIDE_M / REACH_M) // 2 * 2)
        self._image = Image.new("RGB", size, LIGHT["paper"])
        self._draw = ImageDraw.Draw(self._image, "RGBA")
        self._font = ImageFont.load_default(TEXT_M * self._metre)

    def image(self) -> Image.Image:
        """What is drawn so far."""
        return self._image.reduce(SHARP)

    def dots(self, uv: Float64, colour: str, width: float) -> None:
        """Squares."""
        side, at = max(SHARP, round(width * self._metre)), self._at(uv - width / 2).astype(np.int64)
        pixels = np.array(self._image)
        rows, columns = pixels.shape[:2]
        for dv in range(side):
            for du in range(side):
                u, v = at[:, 0] + du, at[:, 1] + dv
                shown = (u >= 0) & (v >= 0) & (u < columns) & (v < rows)
                pixels[v[shown], u[shown]] = _rgb(colour)
        self._image.paste(Image.fromarray(pixels))

    def polygon(
        self, uv: Float64, fill: str, opacity: float, edge: str, width: float, *, dash: float = 0.0, title: str = ""
    ) -> None:
        """An outline."""
        self._draw.polygon(self._points(uv), (*_rgb(fill), round(255 * opacity)))
        closed = np.concatenate([uv, uv[:1]])
        for part in _dashes(closed, dash) if dash else [closed]:
            self.line(part, edge, width)

    def line(self, uv: Float64, colour: str, width: float) -> None:
        """A line."""
        if len(uv) > 1:
            self._draw.line(self._points(uv), _rgb(colour), self._pixels(width), joint="curve")

    def circle(self, u: float, v: float, radius: float, colour: str, width: float) -> None:
        """A circle."""
        corners = self._points(np.array([[u - radius, v - radius], [u + radius, v + radius]]))
        self._draw.ellipse(corners, outline=_rgb(colour), width=self._pixels(width))

    def text(self, u: float, v: float, text: str, colour: str) -> None:
        """Text."""
        ((x, y),) = self._points(np.array([[u, v]]))
        halo = self._pixels(0.15)
        self._draw.text((x, y), text, _rgb(colour), self._font, "ls", stroke_width=halo, stroke_fill=LIGHT["paper"])

    def _at(self, uv: Float64) -> Float64:
        at: Float64 = (uv + np.array([REACH_M, SIDE_M])) * self._metre
        return at

    def _points(self, uv: Float64) -> list[tuple[float, float]]:
        return [(u, v) for u, v in self._at(uv).tolist()]

    def _pixels(self, width: float) -> int:
        return max(SHARP, round(width * self._metre))


def _rgb(colour: str) -> tuple[int, int, int]:
    r, g, b = bytes.fromhex(LIGHT.get(colour, colour)[1:])
    return r, g, b


def _dashes(uv: Float64, length: float) -> list[Float64]:
    """Straight parts of a length along a line, as long gaps between them."""
    parts = []
    for a, b in pairwise(uv):
        n = max(1, round(float(np.hypot(*(b - a))) / (2 * length)))
        starts = np.arange(n)[:, None] / n
        parts += [a + (b - a) * np.concatenate([s, s + 0.5 / n])[:, None] for s in starts]
    return parts
