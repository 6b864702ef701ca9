"""HTML of a page, for light and dark screens and for print, by Jinja."""

from __future__ import annotations

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from modt.viewer.theme import THEME
from modt_profiling.reporting.document import Page, Plot

_ENVIRONMENT = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def html(page: Page) -> str:
    """Text of a page; nothing of it lies outside the file."""
    return _ENVIRONMENT.get_template("page.html").render(page=page, theme=THEME)


def svg(plot: Plot) -> Markup:
    """SVG of a plot, in the colours of the page; a line of one point has a mark."""
    from modt_profiling.reporting import plot_svg  # Matplotlib is large, and some pages have no plot

    return plot_svg.svg(plot)


_ENVIRONMENT.filters["svg"] = svg
