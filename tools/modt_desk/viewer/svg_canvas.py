"""A picture as SVG, for light and dark screens."""

from __future__ import annotations

from html import escape

from modt.reporting.page import LIGHT, THEME
from modt.types import Float64
from modt.viewer.look import REACH_M
from modt_desk.viewer.canvas import SIDE_M, TEXT_M

_STYLE = f"""
svg{{background:var(--paper);font-family:system-ui,sans-serif}}path,polyline,circle{{fill:none}}
.dots{{stroke-linecap:square}}
text{{font-size:{TEXT_M}px;paint-order:stroke;stroke:var(--paper);stroke-width:.3px}}
"""


class SvgCanvas:
    """Shapes as elements; `text_of` makes a document of them."""

    def __init__(self) -> None:
        self._parts: list[str] = []

    def document(self, title: str) -> str:
        """The whole picture."""
        view = f"{-REACH_M} {-SIDE_M} {2 * REACH_M} {2 * SIDE_M}"
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" width="1280" role="img">'
        return f"{head}<title>{escape(title)}</title><style>{THEME}{_STYLE}</style>{''.join(self._parts)}</svg>\n"

    def dots(self, uv: Float64, colour: str, width: float) -> None:
        """Squares."""
        d = "".join(f"M{u:.2f} {v:.2f}h0" for u, v in uv.tolist())
        self._parts.append(f'<path class="dots" stroke="{_paint(colour)}" stroke-width="{width:g}" d="{d}"/>')

    def polygon(
        self, uv: Float64, fill: str, opacity: float, edge: str, width: float, *, dash: float = 0.0, title: str = ""
    ) -> None:
        """An outline."""
        dashes = f' stroke-dasharray="{dash:g} {0.8 * dash:g}"' if dash else ""
        about = f"<title>{escape(title)}</title>" if title else ""
        self._parts.append(
            f'<polygon points="{_points(uv)}" fill="{_paint(fill)}" fill-opacity="{opacity:g}" '
            f'stroke="{_paint(edge)}" stroke-width="{width:g}"{dashes}>{about}</polygon>'
        )

    def line(self, uv: Float64, colour: str, width: float) -> None:
        """A line."""
        style = f'stroke="{_paint(colour)}" stroke-width="{width:g}"'
        self._parts.append(f'<polyline points="{_points(uv)}" {style}/>')

    def circle(self, u: float, v: float, radius: float, colour: str, width: float) -> None:
        """A circle."""
        style = f'stroke="{_paint(colour)}" stroke-width="{width:g}"'
        self._parts.append(f'<circle cx="{u:.2f}" cy="{v:.2f}" r="{radius:.2f}" {style}/>')

    def text(self, u: float, v: float, text: str, colour: str) -> None:
        """Text."""
        self._parts.append(f'<text x="{u:.2f}" y="{v:.2f}" fill="{_paint(colour)}">{escape(text)}</text>')


def _paint(colour: str) -> str:
    return f"var(--{colour})" if colour in LIGHT else colour


def _points(uv: Float64) -> str:
    return " ".join(f"{u:.2f},{v:.2f}" for u, v in uv.tolist())
