import importlib.util
from pathlib import Path

from modt.tracking.diagram import mermaid, table
from modt.tracking.states import ACCURATE, EFFICIENT

ROOT = Path(__file__).parents[2]


def test_the_document_shows_the_machines_as_they_are():
    specification = importlib.util.spec_from_file_location("state_diagrams", ROOT / "tools" / "state_diagrams.py")
    tool = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(tool)
    text = (ROOT / "docs" / "states.md").read_text(encoding="utf-8")
    assert tool.renewed(text) == text


def test_every_transition_is_drawn_and_listed():
    for machine in (EFFICIENT, ACCURATE):
        drawn = mermaid(machine)
        for t in machine.transitions:
            (arrow,) = [line for line in drawn.splitlines() if f" {t.source} --> {t.target}:" in line]
            assert t.event in arrow
        assert len(table(machine).splitlines()) == len(machine.transitions) + 2
