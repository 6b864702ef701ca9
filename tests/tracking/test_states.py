"""The state machines, state by event."""

import itertools

import numpy as np
import pytest

from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT, Event, UndefinedTransitionError
from modt.types import NONE

WAITING = {
    ("unmatched", Event.ASSOCIATED): ("e1", "unmatched"),
    ("matched", Event.JOINS_WAITING): ("e2", "unmatched"),
    ("unmatched", Event.UNASSOCIATED): ("e3", "lost_unmatched"),
    ("lost_unmatched", Event.ASSOCIATED): ("e4", "unmatched"),
    ("lost_unmatched", Event.UNASSOCIATED): ("e5", "lost_unmatched"),
    ("lost_unmatched", Event.EXPIRED): ("e6", "deleted"),
}
TABLE_I = {
    ("proposal", Event.ASSOCIATED): ("a1", "matched"),
    ("proposal", Event.UNASSOCIATED): ("a2", "unmatched"),
    ("unmatched", Event.CLASSIFIED): ("a3", "tracked"),
    ("tracked", Event.ASSOCIATED): ("a4", "tracked"),
    ("matched", Event.JOINS_FINAL): ("a5", "tracked"),
    ("tracked", Event.UNASSOCIATED): ("a6", "lost"),
    ("lost", Event.ASSOCIATED): ("a7", "tracked"),
    ("lost", Event.UNASSOCIATED): ("a8", "lost"),
    ("lost", Event.EXPIRED): ("a9", "deleted"),
} | WAITING
ONE_VIEW = {
    ("tracked", Event.WITHDRAWN): ("e12", "unmatched"),
    ("unmatched", Event.UNDECIDED): ("e13", "unmatched"),
}
TABLE_II = {
    ("proposal", Event.ASSOCIATED): ("a1", "matched"),
    ("proposal", Event.UNASSOCIATED): ("a2", "unmatched"),
    ("unmatched", Event.UNDECIDED): ("a3", "tracked_unclassified"),
    ("unmatched", Event.CLASSIFIED): ("a4", "tracked_classified"),
    ("matched", Event.JOINS_UNCERTAIN): ("a5", "tracked_unclassified"),
    ("matched", Event.JOINS_FINAL): ("a6", "tracked_classified"),
    ("tracked_classified", Event.ASSOCIATED): ("a7", "tracked_classified"),
    ("tracked_unclassified", Event.CLASSIFIED): ("a8", "tracked_classified"),
    ("tracked_unclassified", Event.ASSOCIATED): ("a9", "tracked_unclassified"),
    ("tracked_classified", Event.UNASSOCIATED): ("a10", "lost_classified"),
    ("lost_classified", Event.ASSOCIATED): ("a11", "tracked_classified"),
    ("tracked_unclassified", Event.UNASSOCIATED): ("a12", "lost_unclassified"),
    ("lost_unclassified", Event.ASSOCIATED): ("a13", "tracked_unclassified"),
    ("lost_classified", Event.EXPIRED): ("a14", "deleted"),
    ("lost_unclassified", Event.EXPIRED): ("a14", "deleted"),
    ("tracked_unclassified", Event.UNDECIDED): ("e7", "tracked_unclassified"),
    ("lost_classified", Event.UNASSOCIATED): ("e8", "lost_classified"),
    ("lost_unclassified", Event.UNASSOCIATED): ("e9", "lost_unclassified"),
    ("tracked_classified", Event.CLASSIFIED): ("e10", "tracked_classified"),
    ("tracked_classified", Event.UNDECIDED): ("e11", "tracked_unclassified"),
    ("tracked_classified", Event.WITHDRAWN): ("e12", "unmatched"),
} | WAITING
TABLES = {
    "efficient": (EFFICIENT, TABLE_I | ONE_VIEW),
    "conventional": (CONVENTIONAL, TABLE_I | {("tracked", Event.CLASSIFIED): ("e7", "tracked")}),
    "accurate": (ACCURATE, TABLE_II),
}
each_machine = pytest.mark.parametrize("machine", [machine for machine, _ in TABLES.values()], ids=TABLES)


@pytest.mark.parametrize(("machine", "table"), TABLES.values(), ids=TABLES)
def test_rows_are_those_of_the_tables_and_any_other_event_is_an_error(machine, table):
    assert len(machine.transitions) == len(table)
    assert {(t.source, t.event): (t.label, t.target) for t in machine.transitions} == table
    for state, event in itertools.product(machine.names, Event):
        states = np.array([machine.index(state)])
        if (state, event) in table:
            assert machine.names[machine.transition(states, event)[0]] == table[state, event][1]
        else:
            with pytest.raises(UndefinedTransitionError, match=f"{machine.title}: {event.name} in state {state}"):
                machine.transition(states, event)


@each_machine
def test_an_array_of_states_takes_one_event_each(machine):
    sources = np.array([machine.index(t.source) for t in machine.transitions])
    events = np.array([t.event for t in machine.transitions])
    targets = np.array([machine.index(t.target) for t in machine.transitions])
    np.testing.assert_array_equal(machine.transition(sources, events), targets)
    assert len(machine.transition(sources[:0], Event.ASSOCIATED)) == 0


@each_machine
def test_one_undefined_transition_among_many_is_an_error(machine):
    states = np.array([machine.proposal, machine.index("deleted")])
    with pytest.raises(UndefinedTransitionError, match="ASSOCIATED in state deleted"):
        machine.transition(states, Event.ASSOCIATED)


@each_machine
def test_a_matched_proposal_and_its_track_end_in_one_state(machine):
    tracks = (machine.after[:, Event.ASSOCIATED] != NONE).nonzero()[0]
    tracks = tracks[tracks != machine.proposal]
    after = machine.transition(tracks, Event.ASSOCIATED)
    np.testing.assert_array_equal(machine.joined(after), after)


@pytest.mark.parametrize(
    ("machine", "final", "wants_class"),
    [
        (EFFICIENT, {"tracked", "lost"}, {"unmatched"}),
        (CONVENTIONAL, set(), {"unmatched"}),
        (ACCURATE, {"tracked_classified", "lost_classified"}, {"unmatched", "tracked_unclassified"}),
    ],
    ids=TABLES,
)
def test_states_whose_class_is_final_or_wanted(machine, final, wants_class):
    assert {name for name, flag in zip(machine.names, machine.final, strict=True) if flag} == final
    assert {name for name, flag in zip(machine.names, machine.wants_class, strict=True) if flag} == wants_class
