"""Writes the diagrams and tables of docs/states.md from the state machines themselves."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.tracking.states import ACCURATE, EFFICIENT, StateMachine

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "states.md"


def mermaid(machine: StateMachine) -> str:
    """The machine as a Mermaid state diagram, one arrow for all events between two states."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for t in machine.transitions:
        arrows.setdefault((t.source, t.target), []).append(t.label)
    lines = [f"    {a} --> {b}: {', '.join(dict.fromkeys(labels))}" for (a, b), labels in arrows.items()]
    first, last = machine.names[machine.proposal], machine.names[machine.deleted]
    return "\n".join(["stateDiagram-v2", f"    [*] --> {first}", *lines, f"    {last} --> [*]"])


def table(machine: StateMachine) -> str:
    """The machine as a Markdown table of its transitions."""
    rows = [
        f"| {t.event} | {t.source} | {t.target} | {t.happening.name.lower()} | {t.meaning} |"
        for t in machine.transitions
    ]
    return "\n".join(["| event | from | to | set off by | meaning |", "|---|---|---|---|---|", *rows])


def section(machine: StateMachine) -> str:
    """What the document says of a machine between its marks."""
    return f"\n```mermaid\n{mermaid(machine)}\n```\n\n{table(machine)}\n"


def renewed(text: str) -> str:
    """The document with the sections of both machines as they are now."""
    for machine in (EFFICIENT, ACCURATE):
        begin, end = f"<!-- {machine.title} -->", f"<!-- end of {machine.title} -->"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f"{before}{begin}{section(machine)}{end}{after}"
    return text


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(renewed(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
