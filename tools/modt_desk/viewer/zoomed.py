"""A canvas on which a metre is longer."""

from __future__ import annotations

from modt.types import Float64
from modt_desk.viewer.canvas import Canvas


class Zoomed:
    """Draws shapes larger by a factor; widths of lines stay."""

    def __init__(self, canvas: Canvas, factor: float) -> None:
        self._canvas, self.factor = canvas, factor

    def dots(self, uv: Float64, colour: str, width: float) -> None:
        """Squares, larger too."""
        self._canvas.dots(self.factor * uv, colour, self.factor * width)

    def polygon(
        self, uv: Float64, fill: str, opacity: float, edge: str, width: float, *, dash: float = 0.0, title: str = ""
    ) -> None:
        """An outline."""
        self._canvas.polygon(self.factor * uv, fill, opacity, edge, width, dash=dash, title=title)

    def line(self, uv: Float64, colour: str, width: float) -> None:
        """A line."""
        self._canvas.line(self.factor * uv, colour, width)

    def circle(self, u: float, v: float, radius: float, colour: str, width: float) -> None:
        """A circle."""
        self._canvas.circle(self.factor * u, self.factor * v, self.factor * radius, colour, width)
