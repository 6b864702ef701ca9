"""The generated part of docs/states.md."""

from modt.tracking.states import ACCURATE, EFFICIENT
from tools.docs.state_diagrams import DOCUMENT, mermaid, replace_sections, table


def test_the_document_is_up_to_date():
    text = DOCUMENT.read_text(encoding="utf-8")
    assert replace_sections(text) == text


def test_every_transition_is_drawn_and_listed():
    for machine in (EFFICIENT, ACCURATE):
        drawn = mermaid(machine)
        for t in machine.transitions:
            (arrow,) = [line for line in drawn.splitlines() if f" {t.source} --> {t.target}:" in line]
            assert t.label in arrow
        assert len(table(machine).splitlines()) == len(machine.transitions) + 2
