"""The HTML page that shows a run: its shell and its legends."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from modt.energy.ledger import PIPELINE
from modt.viewer import theme
from modt.viewer.packed import LEVEL_M, SIDE
from modt.viewer.theme import REACH_M, THEME
from modt.viewer.track_rows import COLUMNS, SCALE

_PAGE = Path(__file__).parent / "page"
_SCRIPTS = [_PAGE / f"{part}.js" for part in ("data", "draw", "text", "input")]
LIVE = _PAGE / "live.js"


def content(states: list[theme.Entry], budget: str | None, step_cm: int | None) -> dict[str, Any]:
    """Content of a page: columns, legends, budget of a frame, width of a cell (None without points)."""
    return {
        "columns": [(name, SCALE.get(name, 1)) for name in COLUMNS],
        "classes": theme.classes(),
        "states": states,
        "stages": theme.stages(),
        "pipeline": PIPELINE,
        "kinds": theme.kinds(),
        "budget": budget,
        "points": None if step_cm is None else {"side": SIDE, "step_cm": step_cm, "level_m": LEVEL_M},
        "reach_m": REACH_M,
        "frames": [],
    }


def trust_text(trust: Mapping[str, Any]) -> str:
    """Level of a recorded trust, and the causes of one that is not good."""
    return "; ".join([trust["level"], *(reason["cause"] for reason in trust["reasons"])])


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
