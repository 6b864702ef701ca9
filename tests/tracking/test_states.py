import numpy as np
import pytest

from modt.tracking.states import ACCURATE, EFFICIENT, Event, UndefinedTransitionError
from modt.types import NONE

MACHINES = [EFFICIENT, ACCURATE]
PAPER = {
    EFFICIENT: {
        ("proposal", "a1", "matched"),
        ("proposal", "a2", "unmatched"),
        ("unmatched", "a3", "tracked"),
        ("tracked", "a4", "tracked"),
        ("matched", "a5", "tracked"),
        ("tracked", "a6", "lost"),
        ("lost", "a7", "tracked"),
        ("lost", "a8", "lost"),
        ("lost", "a9", "deleted"),
    },
    ACCURATE: {
        ("proposal", "a1", "matched"),
        ("proposal", "a2", "unmatched"),
        ("unmatched", "a3", "tracked_unclassified"),
        ("unmatched", "a4", "tracked_classified"),
        ("matched", "a5", "tracked_unclassified"),
        ("matched", "a6", "tracked_classified"),
        ("tracked_classified", "a7", "tracked_classified"),
        ("tracked_unclassified", "a8", "tracked_classified"),
        ("tracked_unclassified", "a9", "tracked_unclassified"),
        ("tracked_classified", "a10", "lost_classified"),
        ("lost_classified", "a11", "tracked_classified"),
        ("tracked_unclassified", "a12", "lost_unclassified"),
        ("lost_unclassified", "a13", "tracked_unclassified"),
        ("lost_classified", "a14", "deleted"),
        ("lost_unclassified", "a14", "deleted"),
    },
}

pytestmark = pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.title)


def test_every_state_by_every_event(machine):
    defined = {(t.source, t.label): t.target for t in machine.transitions}
    for state in range(len(machine.names)):
        for label in range(len(machine.labels)):
            one, which = np.array([state]), np.array([label])
            target = defined.get((machine.names[state], machine.labels[label]))
            if target is None:
                with pytest.raises(UndefinedTransitionError, match=machine.title):
                    machine.fire(one, which)
            else:
                assert machine.names[machine.fire(one, which)[0]] == target


def test_the_papers_events_stand_as_the_paper_has_them(machine):
    rows = {(t.source, t.label, t.target) for t in machine.transitions if t.label.startswith("a")}
    assert rows == PAPER[machine]


def test_every_state_by_every_happening_answers_with_at_most_one_event(machine):
    pairs = [(t.source, t.event) for t in machine.transitions]
    assert len(pairs) == len(set(pairs))
    for state in range(len(machine.names)):
        for event in Event:
            label = machine.answer[state, event]
            if label == NONE:
                with pytest.raises(UndefinedTransitionError):
                    machine.transition(np.array([state]), event)
            else:
                (t,) = [t for t in machine.transitions if t.source == machine.names[state] and t.event is event]
                assert machine.labels[label] == t.label
                assert machine.transition(np.array([state]), event)[0] == machine.index(t.target)


def test_arrays_of_states_move_together(machine):
    sources = np.array([machine.index(t.source) for t in machine.transitions])
    labels = np.array([machine.labels.index(t.label) for t in machine.transitions])
    targets = np.array([machine.index(t.target) for t in machine.transitions])
    np.testing.assert_array_equal(machine.fire(sources, labels), targets)
    events = np.array([t.event for t in machine.transitions])
    np.testing.assert_array_equal(machine.transition(sources, events), targets)


def test_one_bad_row_is_an_error(machine):
    states = np.array([machine.proposal, machine.deleted])
    with pytest.raises(UndefinedTransitionError, match="deleted"):
        machine.transition(states, Event.ASSOCIATED)


def test_every_state_is_reached_and_only_the_end_is_final(machine):
    reached = {machine.names[machine.proposal]}
    for _ in machine.names:
        reached |= {t.target for t in machine.transitions if t.source in reached}
    assert reached == set(machine.names)
    assert {t.source for t in machine.transitions} == set(machine.names) - {machine.names[machine.deleted]}


def test_no_rows_are_fine(machine):
    none = np.zeros(0, np.int64)
    assert len(machine.transition(none, Event.ASSOCIATED)) == 0


def test_a_proposal_inherits_what_its_track_then_is(machine):
    """A matched proposal and the track that it joined end in the same state."""
    alive = [
        s for s in range(len(machine.names)) if s != machine.proposal and machine.answer[s, Event.ASSOCIATED] != NONE
    ]
    track = np.array(alive)
    matched = machine.transition(np.full(len(track), machine.proposal), Event.ASSOCIATED)
    np.testing.assert_array_equal(
        machine.transition(matched, machine.inherits(track)), machine.transition(track, Event.ASSOCIATED)
    )
