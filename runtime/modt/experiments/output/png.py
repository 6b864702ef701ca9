"""Charts as PNG, by the extra `report`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.util import find_spec

_SCALE = 2.0


def pictures(texts: Mapping[str, str]) -> Iterator[tuple[str, bytes]]:
    """Name and content of a PNG for each SVG among files by name; none without the extra."""
    if find_spec("resvg_py") is None:
        return
    import resvg_py

    for name, text in texts.items():
        if name.endswith(".svg"):
            yield f"{name.removesuffix('.svg')}.png", resvg_py.svg_to_bytes(svg_string=text, zoom=_SCALE)
