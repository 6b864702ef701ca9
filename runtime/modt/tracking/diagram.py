"""A state machine as a diagram and as a table, in Markdown."""

from __future__ import annotations

from modt.tracking.states import StateMachine


def mermaid(machine: StateMachine) -> str:
    """The machine as a Mermaid state diagram, one arrow for all events between two states."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for t in machine.transitions:
        arrows.setdefault((t.source, t.target), []).append(t.event)
    lines = [f"    {a} --> {b}: {', '.join(dict.fromkeys(events))}" for (a, b), events in arrows.items()]
    first, last = machine.names[machine.proposal], machine.names[machine.deleted]
    return "\n".join(["stateDiagram-v2", f"    [*] --> {first}", *lines, f"    {last} --> [*]"])


def table(machine: StateMachine) -> str:
    """The machine as a Markdown table of its transitions."""
    rows = [
        f"| {t.event} | {t.source} | {t.target} | {t.happening.name.lower()} | {t.meaning} |"
        for t in machine.transitions
    ]
    return "\n".join(["| event | from | to | set off by | meaning |", "|---|---|---|---|---|", *rows])
