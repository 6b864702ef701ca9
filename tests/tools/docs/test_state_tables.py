"""The generated parts of docs/states.md."""

from modt.tracking.states import ACCURATE, EFFICIENT
from tools.docs.state_tables import DOCUMENT, TABLES, document, table


def test_the_document_is_up_to_date():
    assert document() == DOCUMENT.read_text(encoding="utf-8")


def test_every_transition_of_a_machine_is_listed_once():
    for machine in (EFFICIENT, ACCURATE):
        listed = table((*TABLES[machine.title], *TABLES["both"]))
        for t in machine.transitions:
            assert listed.count(f"| {t.label} | {t.source} | {t.target} |") == 1
