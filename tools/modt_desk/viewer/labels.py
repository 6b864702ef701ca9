"""Where the labels of a picture find room."""

from __future__ import annotations

import numpy as np

from modt.viewer.look import REACH_M
from modt_desk.viewer.canvas import SIDE_M, TEXT_M, Canvas

LETTER_M = 0.55 * TEXT_M
TRIES = 4
_APART_M = 0.99 * TEXT_M
"""From a line of text to the next, at least."""
_LEADER_M = 0.08
"""Width of the line to what a label further up belongs to."""


class Labels:
    """Writes labels, those that come first where they belong, later ones further up; one without room is left out."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._taken: list[tuple[float, float, float]] = []

    def keep_free(self, left: float, right: float, foot: float) -> None:
        """Write nothing where a line of text would be."""
        self._taken.append((left, right, foot))

    def write(self, u: float, v: float, text: str, colour: str) -> None:
        """A label centred above a point, if that is in the picture."""
        if abs(u) > REACH_M or abs(v) > SIDE_M:
            return
        width = LETTER_M * len(text)
        left = min(max(u - width / 2, -REACH_M), REACH_M - width)
        for foot in (v - k * TEXT_M for k in range(TRIES)):
            if all(left > b or left + width < a or abs(foot - f) > _APART_M for a, b, f in self._taken):
                self.keep_free(left, left + width, foot)
                if foot < v:
                    self._canvas.line(np.array([[u, v], [u, foot]]), "soft", _LEADER_M)
                self._canvas.text(left, foot, text, colour)
                return
