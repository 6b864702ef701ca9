"""Look shared by pages and pictures (extent; colours of classes, states and stages), and the shell of a page."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from modt.classes import CLASS_NAMES, CLASSES
from modt.energy.ledger import STAGES
from modt.viewer.packed import SIDE
from modt.viewer.track_rows import COLUMNS, SCALE

Entry = dict[str, str]
"""`name` and `colour` of a line of a legend."""

COLOURS = ("#3b6ea5", "#a0527a", "#4c9a5b", "#8a63b8", "#c2493d", "#6b7785", "#b59a2a", "#3a97a6")
LIGHT = {"ink": "#1c2430", "soft": "#5d6876", "line": "#d8dde4", "paper": "#ffffff", "panel": "#f6f8fa"}
DARK = {"ink": "#e4e8ee", "soft": "#9aa6b5", "line": "#38424f", "paper": "#151a21", "panel": "#1d242d"}


def _variables(theme: dict[str, str]) -> str:
    return ":root{" + ";".join(f"--{name}:{colour}" for name, colour in theme.items()) + "}"


THEME = f"""
{_variables(LIGHT)}
@media (prefers-color-scheme:dark){{{_variables(DARK)}}}
"""
"""Colours of pages, for light and dark screens."""

REACH_M = 45.0
"""Half of the visible width [m]."""
_GREY = COLOURS[5]
_STATE_COLOURS = {
    "unmatched": _GREY,
    "lost_unmatched": _GREY,
    "tracked": COLOURS[2],
    "tracked_classified": COLOURS[2],
    "tracked_unclassified": COLOURS[6],
    "lost": COLOURS[3],
    "lost_classified": COLOURS[3],
    "lost_unclassified": COLOURS[1],
}


def classes() -> list[Entry]:
    """Legend of the classes, in their order."""
    return [{"name": name, "colour": spec.colour} for name, spec in zip(CLASS_NAMES, CLASSES.values(), strict=True)]


def states(names: Iterable[str]) -> list[Entry]:
    """Legend of states: grey while waiting, green if tracked, ochre if unclassified, violet or plum if lost."""
    return [{"name": name, "colour": _STATE_COLOURS.get(name, _GREY)} for name in names]


def stages(names: Sequence[str] = STAGES) -> list[Entry]:
    """Legend of the stages of a frame."""
    return [{"name": name, "colour": COLOURS[k % len(COLOURS)]} for k, name in enumerate(names)]


_PAGE = Path(__file__).parent / "page"
_SCRIPTS = [_PAGE / f"{part}.js" for part in ("data", "draw", "text", "input")]
LIVE = _PAGE / "live.js"


def content(states: list[Entry], budget: str | None, step_cm: int | None) -> dict[str, Any]:
    """Content of a page: columns, legends, budget of a frame, width of a cell (None without points)."""
    return {
        "schema": "modt.player/2",
        "columns": [(name, SCALE.get(name, 1)) for name in COLUMNS],
        "classes": classes(),
        "states": states,
        "stages": stages(),
        "budget": budget,
        "points": None if step_cm is None else {"side": SIDE, "step_cm": step_cm},
        "reach_m": REACH_M,
        "frames": [],
    }


def page(name: str, about: str, known: dict[str, Any], script: Path) -> tuple[str, str]:
    """HTML before and after the data of a page. The script fetches the frames and handles Play."""
    css, body = ((_PAGE / f"page.{kind}").read_text(encoding="utf-8") for kind in ("css", "html"))
    scripts = "".join(part.read_text(encoding="utf-8") for part in (*_SCRIPTS, script))
    text = json.dumps(known, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    head = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(name)}</title><style>{THEME}{css}</style></head><body>\n"
        f"<header><h1>{escape(name)}</h1><span>{escape(about)}</span></header>\n{body}"
        f'<script type="application/json" id="run">{text}</script>\n'
    )
    return head, f"<script>\n{scripts}</script></body></html>\n"
