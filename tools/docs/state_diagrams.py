"""Generate the diagrams and tables of docs/states.md from the state machines."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.tracking.states import ACCURATE, EFFICIENT, StateMachine

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "states.md"


def mermaid(machine: StateMachine) -> str:
    """Mermaid state diagram, with one arrow for all events between two states."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for t in machine.transitions:
        arrows.setdefault((t.source, t.target), []).append(t.label)
    lines = [f"    {a} --> {b}: {', '.join(dict.fromkeys(labels))}" for (a, b), labels in arrows.items()]
    first, last = machine.names[0], machine.names[-1]
    return "\n".join(["stateDiagram-v2", f"    [*] --> {first}", *lines, f"    {last} --> [*]"])


def table(machine: StateMachine) -> str:
    """Markdown table of the transitions."""
    rows = [
        f"| {t.label} | {t.source} | {t.target} | {t.event.name.lower()} | {t.meaning} |" for t in machine.transitions
    ]
    return "\n".join(["| event | from | to | set off by | meaning |", "|---|---|---|---|---|", *rows])


def section(machine: StateMachine) -> str:
    """Text of a machine between its marks."""
    return f"\n```mermaid\n{mermaid(machine)}\n```\n\n{table(machine)}\n"


def replace_sections(text: str) -> str:
    """The document with the sections of both machines replaced."""
    for machine in (EFFICIENT, ACCURATE):
        begin, end = f"<!-- {machine.title} -->", f"<!-- end of {machine.title} -->"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f"{before}{begin}{section(machine)}{end}{after}"
    return text


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(replace_sections(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
