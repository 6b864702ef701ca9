"""Look shared by pages and pictures: extent, and colours of classes, states and stages."""

from __future__ import annotations

from collections.abc import Iterable

from modt.energy.ledger import STAGES
from modt.publication import KIND_COLOURS, KIND_NAMES

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
    """Legend of the classes, and of the further kinds that are published, in their order."""
    return [{"name": name, "colour": colour} for name, colour in zip(KIND_NAMES, KIND_COLOURS, strict=True)]


def states(names: Iterable[str]) -> list[Entry]:
    """Legend of states: grey while waiting, green if tracked, ochre if unclassified, violet or plum if lost."""
    return [{"name": name, "colour": _STATE_COLOURS.get(name, _GREY)} for name in names]


def kinds() -> list[Entry]:
    """Legend of the points of no proposal, by their groups (`packed.group_of`)."""
    named = {"overhead": COLOURS[7], "low or sparse": COLOURS[4], "structure": COLOURS[3]}
    return [{"name": name, "colour": colour} for name, colour in named.items()]


def stages() -> list[Entry]:
    """Legend of the stages of a frame."""
    return [{"name": name, "colour": colour} for name, colour in zip(STAGES, COLOURS, strict=True)]
