"""The step: every stage once, in order, with what the one before it made."""

import numpy as np
import pytest

from modt.energy.ledger import Ledger
from modt.pipeline import STAGES, Pipeline
from modt.types import NONE, Budget, Frame, Tracks
from tests.results import STATES, proposals


class Selected:
    def __init__(self, rows, deferred):
        self.rows, self.deferred = np.array(rows, np.int64), deferred


class Stages:
    """All stages at once, noting what they are called with."""

    state_names = STATES

    def __init__(self, choose=lambda asks, budget: np.flatnonzero(asks)):
        self.calls, self.choose = [], choose
        self.tracks = Tracks.blank(3)
        self.tracks.id[:] = [4, 5, 6]
        self.tracks.proposal[:] = [1, NONE, 0]

    def segment(self, points):
        self.calls.append(("segment", len(points)))
        return proposals([3, 4])

    def follow(self, frame, found):
        self.calls.append(("follow", frame.index, len(found)))
        self.proposals = found
        return self.tracks

    def asking(self):
        return np.array([True, False, True])

    def asks(self, tracks, found, asking):
        self.calls.append(("asks", asking.tolist()))
        return asking

    def select(self, tracks, found, asks, budget):
        rows = self.choose(asks, budget)
        self.calls.append(("select", budget))
        return Selected(rows, int(asks.sum()) - len(rows))

    def classify(self, points, found, which):
        self.calls.append(("classify", which.tolist()))
        return np.tile([0.0, 1, 0, 0], (len(which), 1))

    def fuse(self, tracks, found, rows, likelihood):
        self.calls.append(("fuse", rows.tolist(), likelihood.shape))
        tracks.posterior[rows] = likelihood
        return np.ones(len(rows), np.bool_)

    def settle(self, rows, certain):
        self.calls.append(("settle", rows.tolist(), certain.tolist()))


FRAME = Frame(7, 0.7, np.ones((9, 4), np.float32))


def pipeline(stages):
    return Pipeline(stages, stages, stages, stages, stages, Ledger())


def test_the_stages_run_once_and_in_order():
    stages = Stages()
    pipe = pipeline(stages)
    result = pipe.step(FRAME, Budget(calls=5))
    assert stages.calls == [
        ("segment", 9),
        ("follow", 7, 2),
        ("asks", [True, False, True]),
        ("select", Budget(calls=5)),
        ("classify", [1, 0]),  # the proposals of rows 0 and 2
        ("fuse", [0, 2], (2, 4)),
        ("settle", [0, 2], [True, True]),
    ]
    assert (result.n_classified, result.n_deferred) == (2, 0)
    assert set(pipe.ledger.close_frame(7)["stages"]) == set(STAGES)


def test_without_a_choice_nothing_is_classified():
    stages = Stages(choose=lambda asks, budget: [])
    pipe = pipeline(stages)
    result = pipe.step(FRAME)
    assert [c[0] for c in stages.calls] == ["segment", "follow", "asks", "select"]
    assert (result.n_classified, result.n_deferred) == (0, 2)
    assert "classification" not in pipe.ledger.close_frame(7)["stages"]


def test_a_result_outlives_the_tables_it_was_made_from():
    stages = Stages()
    result = pipeline(stages).step(FRAME)
    stages.tracks.id[:] = 99
    assert result.tracks.id.tolist() == [4, 5, 6]


def test_a_stage_that_fails_is_still_booked():
    stages = Stages()
    stages.segment = lambda points: 1 / 0
    pipe = pipeline(stages)
    with pytest.raises(ZeroDivisionError):
        pipe.step(FRAME)
    assert pipe.ledger.close_frame(7)["stages"]["segmentation"]["calls"] == 1
