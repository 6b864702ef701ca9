"""Charts as PNG, by the extra `report`."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from importlib.util import find_spec

log = logging.getLogger(__name__)

_SCALE = 2.0
_SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="40" height="20">{}</svg>'


def draws_text() -> bool:
    """Whether this machine has a font; without one text is left out."""
    import resvg_py

    text, empty = (resvg_py.svg_to_bytes(svg_string=_SVG.format(own)) for own in ('<text y="15">x</text>', ""))
    return text != empty


def pictures(texts: Mapping[str, str]) -> Iterator[tuple[str, bytes]]:
    """Name and content of a PNG for each SVG among files by name; none without the extra."""
    if find_spec("resvg_py") is None:
        return
    import resvg_py

    if not draws_text():
        log.warning("PNG charts have no text: the machine has no fonts; install some (apt install fonts-dejavu-core)")
    for name, text in texts.items():
        if name.endswith(".svg"):
            yield f"{name.removesuffix('.svg')}.png", resvg_py.svg_to_bytes(svg_string=text, zoom=_SCALE)
