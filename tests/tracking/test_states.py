"""The state machines; test_lifecycle.py leads a track over every row of their tables."""

import itertools

import numpy as np
import pytest

from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT, Event, UndefinedTransitionError
from modt.types import NONE

MACHINES = {"efficient": EFFICIENT, "conventional": CONVENTIONAL, "accurate": ACCURATE}
each_machine = pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES)


@each_machine
def test_arrays_of_states_follow_their_rows_and_an_event_without_a_row_is_an_error(machine):
    rows = {(machine.index(t.source), t.event): machine.index(t.target) for t in machine.transitions}
    assert len(rows) == len(machine.transitions)
    sources, events = np.array(list(rows)).T
    np.testing.assert_array_equal(machine.transition(sources, events), list(rows.values()))
    assert len(machine.transition(sources[:0], Event.ASSOCIATED)) == 0
    for state, event in set(itertools.product(range(len(machine.names)), Event)) - set(rows):
        known = sources[events == event][:1]
        with pytest.raises(UndefinedTransitionError, match=f"{event.name} in state {machine.names[state]}"):
            machine.transition(np.array([*known, state]), event)


@each_machine
def test_a_matched_proposal_and_its_track_end_in_one_state(machine):
    tracks = (machine.after[:, Event.ASSOCIATED] != NONE).nonzero()[0]
    tracks = tracks[tracks != machine.proposal]
    after = machine.transition(tracks, Event.ASSOCIATED)
    np.testing.assert_array_equal(machine.joined(after), after)
