"""Writes the diagrams and tables of docs/states.md from the state machines themselves."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.tracking.diagram import mermaid, table
from modt.tracking.states import ACCURATE, EFFICIENT, StateMachine

DOCUMENT = Path(__file__).parent.parent / "docs" / "states.md"


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
