"""Generate the diagrams and tables of docs/states.md from the state machines."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.tracking.states import ACCURATE, EFFICIENT, StateMachine, Transition
from tools.docs.sections import replace_section

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "states.md"
COMMON = "both"
SHARED = tuple(t for t in EFFICIENT.transitions if t.label.startswith("e"))


def mermaid(machine: StateMachine) -> str:
    """Mermaid state diagram, with one arrow for all events between two states."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for t in machine.transitions:
        arrows.setdefault((t.source, t.target), []).append(t.label)
    lines = [f"    {a} --> {b}: {', '.join(dict.fromkeys(labels))}" for (a, b), labels in arrows.items()]
    first, last = machine.names[0], machine.names[-1]
    return "\n".join(["stateDiagram-v2", f"    [*] --> {first}", *lines, f"    {last} --> [*]"])


def table(transitions: tuple[Transition, ...]) -> str:
    """Markdown table of transitions."""
    rows = [f"| {t.label} | {t.source} | {t.target} | {t.event.name.lower()} | {t.meaning} |" for t in transitions]
    return "\n".join(["| row | from | to | event | meaning |", "|---|---|---|---|---|", *rows])


def section(machine: StateMachine) -> str:
    """Diagram of a machine, and the table of its own rows."""
    own = tuple(t for t in machine.transitions if t not in SHARED)
    return f"```mermaid\n{mermaid(machine)}\n```\n\n{table(own)}"


def document() -> str:
    """The page with its sections up to date."""
    text = DOCUMENT.read_text(encoding="utf-8")
    for machine in (EFFICIENT, ACCURATE):
        text = replace_section(text, machine.title, section(machine))
    return replace_section(text, COMMON, table(SHARED))


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(document(), encoding="utf-8")


if __name__ == "__main__":
    main()
