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
    """State after every frame of a scene with one object, "gone" when its track is deleted.

    A step says whether the object is seen, seen 1 m further on ("moved"), hidden, or classified as certain or not.
    """
    stub = Scripted()
    tracker = Tracker(TrackingConfig(max_missed=MAX_MISSED), machine)
    pipeline = Pipeline(stub, Odometry(), tracker, stub, stub, stub, stub, Ledger())
    states = []
    for i, step in enumerate(script):
        boxes = [] if step == "hidden" else [box(11 if step == "moved" else 10, 2)]
        frame, stub.proposals = frame_of(boxes, i, EYE)
        stub.certain = {"certain": True, "uncertain": False}.get(step)
        tracks = pipeline.step(frame).tracks
        np.testing.assert_array_equal(tracks.final, machine.final[tracks.state])
        np.testing.assert_array_equal(tracker.tracks.final, machine.final[tracker.tracks.state])
        assert len(tracks) <= 1
        states.append(machine.names[tracks.state[0]] if len(tracks) else "gone")
    return states


WAITING = """seen unmatched, seen unmatched, hidden lost_unmatched, hidden lost_unmatched, seen unmatched,
    hidden lost_unmatched, hidden lost_unmatched, hidden gone"""
UNCERTAIN_ONCE = "uncertain unmatched, seen unmatched, certain tracked"
CLASSIFIED_ONCE = """certain tracked, seen tracked, hidden lost, hidden lost, seen tracked,
    hidden lost, hidden lost, hidden gone"""
REMEMBERED_ONCE = f"{CLASSIFIED_ONCE}, seen tracked, moved unmatched"
NOT_REMEMBERED = f"{CLASSIFIED_ONCE}, seen unmatched, moved unmatched"
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
REMEMBERED = f"{CERTAIN_AT_ONCE}, seen tracked_classified, moved unmatched"
LIVES = {
    "efficient": (EFFICIENT, [WAITING, UNCERTAIN_ONCE, CLASSIFIED_ONCE, REMEMBERED_ONCE]),
    "conventional": (CONVENTIONAL, [WAITING, CLASSIFIED_ONCE, CLASSIFIED_ALWAYS, NOT_REMEMBERED]),
    "accurate": (
        ACCURATE,
        [WAITING, UNCERTAIN_UNTIL_FUSED, UNCERTAIN_AND_LOST, CERTAIN_AT_ONCE, CLASSIFIED_AGAIN, REMEMBERED],
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
