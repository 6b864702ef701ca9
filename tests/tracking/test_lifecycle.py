"""Lives of tracks through the pipeline: every row of every state machine, and what the machine says is final."""

from types import SimpleNamespace

import numpy as np
import pytest

from modt.classes import ObjectClass
from modt.config import TrackingConfig
from modt.energy.ledger import Ledger
from modt.odometry.odometry import Odometry
from modt.pipeline import Pipeline
from modt.tracking.states import ACCURATE, CONVENTIONAL, EFFICIENT, Event, StateMachine
from modt.tracking.tracker import Tracker
from modt.types import NONE
from tests.tracking.tracking_scenes import EYE, box, frame_of, set_class

MAX_MISSED = 2
SEEN, MOVED, HIDDEN, CERTAIN, UNCERTAIN = "seen", "moved", "hidden", "certain", "uncertain"
"""The object of a scene is visible and not classified, also 1 m on, not visible, or classified with that result."""
GONE = "gone"


class RecordedMachine(StateMachine):
    """A state machine that records the rows it is driven through."""

    def __init__(self, machine):
        super().__init__(machine.title, machine.states, machine.transitions)
        self.__dict__["rows"] = set()

    def transition(self, states, events):
        after = super().transition(states, events)
        for source, event, target in zip(states, np.broadcast_to(events, len(states)), after, strict=True):
            self.rows.add((self.names[source], Event(event), self.names[target]))
        return after


class Scripted:
    """Segmenter, fusion, scheduler and classifier that follow a script."""

    deferred = 0
    cost = SimpleNamespace(size=np.sum)

    def __init__(self):
        self.proposals, self.certain = None, None

    def segment(self, points):
        return self.proposals

    def asks(self, tracks, proposals, wants_class):
        return tracks.proposal != NONE

    def select(self, tracks, proposals, asks, budget):
        self.rows = asks.nonzero()[0] if self.certain is not None else np.zeros(0, np.int64)
        return self

    def classify(self, points, proposals, which):
        return np.full((len(which), 4), 0.25)

    def decide(self, tracks):
        pass

    def fuse(self, tracks, proposals, rows, likelihood):
        for row in rows:
            set_class(tracks, row, ObjectClass.BACKGROUND)
        return np.full(len(rows), self.certain)


def live(machine, script):
    """State after every frame of a scene with one object, GONE when its track is deleted."""
    stub = Scripted()
    tracker = Tracker(TrackingConfig(max_missed=MAX_MISSED), machine)
    pipeline = Pipeline(stub, Odometry(), tracker, stub, stub, stub, stub, Ledger())
    states = []
    for i, step in enumerate(script):
        boxes = [] if step == HIDDEN else [box(11 if step == MOVED else 10, 2)]
        frame, stub.proposals = frame_of(boxes, i, EYE)
        stub.certain = {CERTAIN: True, UNCERTAIN: False}.get(step)
        tracks = pipeline.step(frame).tracks
        np.testing.assert_array_equal(tracks.final, machine.final[tracks.state])
        np.testing.assert_array_equal(tracker.tracks.final, machine.final[tracker.tracks.state])
        assert len(tracks) <= 1
        states.append(machine.names[tracks.state[0]] if len(tracks) else GONE)
    return states


WAITING = [
    (SEEN, "unmatched"),
    (SEEN, "unmatched"),
    (HIDDEN, "lost_unmatched"),
    (HIDDEN, "lost_unmatched"),
    (SEEN, "unmatched"),
    (HIDDEN, "lost_unmatched"),
    (HIDDEN, "lost_unmatched"),
    (HIDDEN, GONE),
]
CLASSIFIED_ONCE = [
    (CERTAIN, "tracked"),
    (SEEN, "tracked"),
    (HIDDEN, "lost"),
    (HIDDEN, "lost"),
    (SEEN, "tracked"),
    (HIDDEN, "lost"),
    (HIDDEN, "lost"),
    (HIDDEN, GONE),
]
CLASSIFIED_ALWAYS = [(CERTAIN, "tracked"), (CERTAIN, "tracked"), (HIDDEN, "lost"), (CERTAIN, "tracked")]
UNCERTAIN_UNTIL_FUSED = [
    (UNCERTAIN, "tracked_unclassified"),
    (SEEN, "tracked_unclassified"),
    (UNCERTAIN, "tracked_unclassified"),
    (HIDDEN, "lost_unclassified"),
    (HIDDEN, "lost_unclassified"),
    (SEEN, "tracked_unclassified"),
    (CERTAIN, "tracked_classified"),
    (SEEN, "tracked_classified"),
]
UNCERTAIN_AND_LOST = [(UNCERTAIN, "tracked_unclassified"), *[(HIDDEN, "lost_unclassified")] * 2, (HIDDEN, GONE)]
CERTAIN_AT_ONCE = [
    (CERTAIN, "tracked_classified"),
    (HIDDEN, "lost_classified"),
    (HIDDEN, "lost_classified"),
    (SEEN, "tracked_classified"),
    (HIDDEN, "lost_classified"),
    (HIDDEN, "lost_classified"),
    (HIDDEN, GONE),
]
CLASSIFIED_AGAIN = [
    (CERTAIN, "tracked_classified"),
    (CERTAIN, "tracked_classified"),
    (UNCERTAIN, "tracked_unclassified"),
    (CERTAIN, "tracked_classified"),
]
REMEMBERED_ONCE = [*CLASSIFIED_ONCE, (SEEN, "tracked"), (MOVED, "unmatched")]
REMEMBERED = [*CERTAIN_AT_ONCE, (SEEN, "tracked_classified"), (MOVED, "unmatched")]
NOT_REMEMBERED = [*CLASSIFIED_ONCE, (SEEN, "unmatched"), (MOVED, "unmatched")]
UNCERTAIN_ONCE = [(UNCERTAIN, "unmatched"), (SEEN, "unmatched"), (CERTAIN, "tracked")]
LIVES = {
    "efficient": (EFFICIENT, [WAITING, UNCERTAIN_ONCE, CLASSIFIED_ONCE, REMEMBERED_ONCE]),
    "conventional": (CONVENTIONAL, [WAITING, CLASSIFIED_ONCE, CLASSIFIED_ALWAYS, NOT_REMEMBERED]),
    "accurate": (
        ACCURATE,
        [WAITING, UNCERTAIN_UNTIL_FUSED, UNCERTAIN_AND_LOST, CERTAIN_AT_ONCE, CLASSIFIED_AGAIN, REMEMBERED],
    ),
}


@pytest.mark.parametrize(("machine", "lives"), LIVES.values(), ids=LIVES)
def test_lives_reach_every_row_of_the_table(machine, lives):
    recorded = RecordedMachine(machine)
    for life in lives:
        assert live(recorded, [step for step, _ in life]) == [state for _, state in life]
    assert recorded.rows == {(t.source, t.event, t.target) for t in machine.transitions}


def test_a_second_look_takes_a_final_class_back():
    recorded = RecordedMachine(ACCURATE)
    live(recorded, [CERTAIN, UNCERTAIN])
    assert ("tracked_classified", Event.UNDECIDED, "tracked_unclassified") in recorded.rows
