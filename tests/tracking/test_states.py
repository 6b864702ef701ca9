"""The state machines, and a track led over every row of their tables."""

import itertools

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT, StateEvent, StateMachine, UndefinedTransitionError
from modt.types import NONE
from tests.tracking.tracking_scenes import EYE, Follower, box, frame_of


class RecordedMachine(StateMachine):
    """A state machine that records the rows it is driven through."""

    def __init__(self, machine):
        super().__init__(machine.title, machine.states, machine.transitions)
        self.__dict__["rows"] = set()

    def transition(self, states, events):
        after = super().transition(states, events)
        for source, event, target in zip(states, np.broadcast_to(events, len(states)), after, strict=True):
            self.rows.add((self.names[source], StateEvent(event), self.names[target]))
        return after


WANT_A_CLASS = {"unmatched", "tracked_unclassified"}
FINAL = {"tracked", "lost", "tracked_classified", "lost_classified"}
"""States whose class is final, but in mode conventional."""


def live(machine, script):
    """State after every frame of a scene with one object, "gone" when its track is deleted.

    A step says whether the object is seen, hidden, or classified as certain or not.
    """
    follower = Follower(TrackingConfig(max_missed=2), machine)
    states = []
    for step in script:
        boxes = [] if step == "hidden" else [box(10, 2)]
        tracks = follower.follow(*frame_of(boxes, follower.frames, EYE))
        assert follower.wants_class.tolist() == [name in WANT_A_CLASS for name in follower.states]
        if step in {"certain", "uncertain"}:
            follower.set_class(0, ObjectClass.BACKGROUND)
            follower.confirm([0], [step == "certain"])
        assert tracks.final.tolist() == [name in FINAL and machine.final.any() for name in follower.states]
        assert len(tracks) <= 1
        states.extend(follower.states or ["gone"])
    return states


WAITING = """seen unmatched, seen unmatched, hidden lost_unmatched, hidden lost_unmatched, seen unmatched,
    hidden lost_unmatched, hidden lost_unmatched, hidden gone"""
UNCERTAIN_ONCE = "uncertain unmatched, seen unmatched, certain tracked"
CLASSIFIED_ONCE = """certain tracked, seen tracked, hidden lost, hidden lost, seen tracked,
    hidden lost, hidden lost, hidden gone"""
CLASSIFIED_ALWAYS = "certain tracked, certain tracked, hidden lost, certain tracked"
UNCERTAIN_UNTIL_FUSED = """uncertain tracked_unclassified, seen tracked_unclassified, uncertain tracked_unclassified,
    hidden lost_unclassified, hidden lost_unclassified, seen tracked_unclassified,
    certain tracked_classified, seen tracked_classified"""
UNCERTAIN_AND_LOST = """uncertain tracked_unclassified, hidden lost_unclassified, hidden lost_unclassified,
    hidden gone"""
CERTAIN_AT_ONCE = """certain tracked_classified, hidden lost_classified, hidden lost_classified,
    seen tracked_classified, hidden lost_classified, hidden lost_classified, hidden gone"""
CLASSIFIED_AGAIN = """certain tracked_classified, certain tracked_classified, uncertain tracked_unclassified,
    certain tracked_classified"""
LIVES = {
    "efficient": (EFFICIENT, [WAITING, UNCERTAIN_ONCE, CLASSIFIED_ONCE]),
    "conventional": (CONVENTIONAL, [WAITING, CLASSIFIED_ONCE, CLASSIFIED_ALWAYS]),
    "accurate": (
        ACCURATE,
        [WAITING, UNCERTAIN_UNTIL_FUSED, UNCERTAIN_AND_LOST, CERTAIN_AT_ONCE, CLASSIFIED_AGAIN],
    ),
}
"""Lives of one object: what happens to it in each frame, and the state that follows."""


@pytest.mark.parametrize(("machine", "lives"), LIVES.values(), ids=LIVES)
def test_lives_reach_every_row_of_the_table(machine, lives):
    recorded = RecordedMachine(machine)
    for life in lives:
        steps, states = zip(*(entry.split() for entry in life.split(",")), strict=True)
        assert live(recorded, steps) == list(states)
    assert recorded.rows == {(t.source, t.event, t.target) for t in machine.transitions}


each_machine = pytest.mark.parametrize("machine", [machine for machine, _ in LIVES.values()], ids=LIVES)


@each_machine
def test_arrays_of_states_follow_their_rows_and_an_event_without_a_row_is_an_error(machine):
    rows = {(machine.index(t.source), t.event): machine.index(t.target) for t in machine.transitions}
    assert len(rows) == len(machine.transitions)
    sources, events = np.array(list(rows)).T
    np.testing.assert_array_equal(machine.transition(sources, events), list(rows.values()))
    assert len(machine.transition(sources[:0], StateEvent.ASSOCIATED)) == 0
    for state, event in set(itertools.product(range(len(machine.names)), StateEvent)) - set(rows):
        known = sources[events == event][:1]
        with pytest.raises(UndefinedTransitionError, match=f"{event.name} in state {machine.names[state]}"):
            machine.transition(np.array([*known, state]), event)


@each_machine
def test_a_matched_proposal_and_its_track_end_in_one_state(machine):
    tracks = (machine.after[:, StateEvent.ASSOCIATED] != NONE).nonzero()[0]
    tracks = tracks[tracks != machine.proposal]
    after = machine.transition(tracks, StateEvent.ASSOCIATED)
    np.testing.assert_array_equal(machine.joined(after), after)
