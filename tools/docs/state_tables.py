"""Generate the tables of docs/states.md from the state machines."""

from __future__ import annotations

from modt.tracking.states import ACCURATE, EFFICIENT, Transition
from tools.docs.sections import DOCS, replace_section, write

DOCUMENT = DOCS / "states.md"
SHARED = tuple(t for t in EFFICIENT.transitions if t in ACCURATE.transitions and t.label.startswith("e"))
TABLES = {
    **{m.title: tuple(t for t in m.transitions if t not in SHARED) for m in (EFFICIENT, ACCURATE)},
    "both": SHARED,
}
"""Rows of each generated section, by its mark."""


def table(transitions: tuple[Transition, ...]) -> str:
    """Markdown table of transitions."""
    rows = [f"| {t.label} | {t.source} | {t.target} | {t.event.name.lower()} |" for t in transitions]
    return "\n".join(["| row | from | to | event |", "|---|---|---|---|", *rows])


def document() -> str:
    """The page with its sections up to date."""
    text = DOCUMENT.read_text(encoding="utf-8")
    for mark, transitions in TABLES.items():
        text = replace_section(text, mark, table(transitions))
    return text


def main() -> None:
    write(__doc__, DOCUMENT, document)


if __name__ == "__main__":
    main()
