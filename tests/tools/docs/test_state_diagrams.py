"""The generated parts of docs/states.md."""

from modt.tracking.states import ACCURATE, EFFICIENT
from tools.docs.state_diagrams import DOCUMENT, SHARED, document, mermaid, section, table


def test_the_document_is_up_to_date():
    assert document() == DOCUMENT.read_text(encoding="utf-8")


def test_every_transition_is_drawn_and_listed_once():
    for machine in (EFFICIENT, ACCURATE):
        drawn, listed = mermaid(machine), section(machine) + table(SHARED)
        for t in machine.transitions:
            (arrow,) = [line for line in drawn.splitlines() if f" {t.source} --> {t.target}:" in line]
            assert t.label in arrow
            assert listed.count(f"| {t.label} | {t.source} | {t.target} |") == 1
