"""What a picture is drawn on, in metres, u to the right and v down; colours are `#rrggbb` or names of the theme."""

from __future__ import annotations

from typing import Protocol

from modt.types import Float64

SIDE_M = 32.0
"""Half of what is shown along v."""
TEXT_M = 1.1
"""Height of text."""


class Canvas(Protocol):
    """Takes shapes, the later ones above."""

    def dots(self, uv: Float64, colour: str, width: float) -> None:
        """Squares of a width at (n, 2) centres."""

    def polygon(
        self, uv: Float64, fill: str, opacity: float, edge: str, width: float, *, dash: float = 0.0, title: str = ""
    ) -> None:
        """A closed outline of (n, 2) corners; dash: length of its dashes, 0 for none."""

    def line(self, uv: Float64, colour: str, width: float) -> None:
        """A line through (n, 2) points."""

    def circle(self, u: float, v: float, radius: float, colour: str, width: float) -> None:
        """The outline of a circle."""

    def text(self, u: float, v: float, text: str, colour: str) -> None:
        """A line of text that begins at a point on its base line."""
