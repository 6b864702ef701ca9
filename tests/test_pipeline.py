"""The step: every stage once, in order, with what the stage before it made."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from modt.classification.scheduler import Selection
from modt.energy.ledger import Ledger
from modt.geometry import rotation_zyx, se3
from modt.observations import Located, observe
from modt.pipeline import CLASSIFICATION, FUSION, ODOMETRY, SCHEDULING, SEGMENTATION, STAGES, TRACKING, Pipeline
from modt.placement import Placement
from modt.types import NONE, Budget, Frame, TrackedFrame, Tracks
from tests.results import STATES, proposals


class Stages:
    """All stages in one, which record their calls."""

    state_names = STATES

    def __init__(self, choose=lambda asks, budget: np.flatnonzero(asks)):
        self.calls, self.choose = [], choose
        self.tracks = Tracks.blank(3)
        self.tracks.id[:] = [4, 5, 6]
        self.tracks.proposal[:] = [1, NONE, 0]
        self.cost = self

    def segment(self, points):
        self.calls.append(("segment", len(points)))
        return proposals([3, 4])

    def static_tracks(self, stamp_s):
        self.calls.append(("static_tracks", stamp_s))

    def locate(self, frame, found, static_tracks):
        self.calls.append(("locate", frame.index, len(found)))
        static_tracks(frame.stamp_s)
        placement = Placement(PLACED)
        return Located(placement, observe(found, placement.T_world_sensor))

    def follow(self, stamp_s, found, located):
        self.calls.append(("follow", stamp_s, len(found), len(located)))
        regrouped = found.take(np.array([1, 0]))
        return TrackedFrame(self.tracks, regrouped, np.array([True, False, True]))

    def asks(self, tracks, found, wants_class):
        self.calls.append(("asks", found.count.tolist(), wants_class.tolist()))
        return wants_class

    def select(self, tracks, found, asks, budget):
        rows = self.choose(asks, budget)
        self.calls.append(("select", budget))
        return Selection(np.array(rows, np.int64), int(asks.sum()) - len(rows))

    def size(self, count):
        return 10 * int(count.sum())

    def paid(self, count, cpu_ms):
        self.calls.append(("paid", count.tolist(), cpu_ms))

    def classify(self, points, found, which):
        self.calls.append(("classify", found.count.tolist(), which.tolist()))
        return np.tile([0.0, 1, 0, 0], (len(which), 1))

    def fuse(self, tracks, found, rows, likelihood):
        self.calls.append(("fuse", rows.tolist(), likelihood.shape))
        tracks.posterior[rows] = likelihood
        return np.arange(len(rows)) == 0

    def decide(self, tracks):
        self.calls.append(("decide",))
        tracks.object_class[:] = tracks.posterior.argmax(axis=1)

    def conclude(self, rows, certain):
        self.calls.append(("conclude", rows.tolist(), certain.tolist()))
        return self.tracks.copy()


FRAME = Frame(7, 0.7, np.ones((9, 4), np.float32))
PLACED = se3(rotation_zyx(0.0, 0.0, 0.3), np.array([4.0, -2.0, 0.1]))


def pipeline(stages):
    return Pipeline(stages, stages, stages, stages, stages, stages, stages, Ledger())


def test_the_stages_run_once_and_in_order():
    stages = Stages()
    pipe = pipeline(stages)
    result = pipe.step(FRAME, Budget(calls=5))
    assert stages.calls == [
        ("segment", 9),
        ("locate", 7, 2),
        ("static_tracks", 0.7),
        ("follow", 0.7, 2, 2),
        ("asks", [4, 3], [True, False, True]),
        ("select", Budget(calls=5)),
        ("classify", [4, 3], [1, 0]),  # the proposals of rows 0 and 2, as regrouped by the tracker
        ("fuse", [0, 2], (2, 4)),
        ("decide",),
        ("conclude", [0, 2], [True, False]),
    ]
    assert (len(result.classified), result.n_deferred) == (2, 0)
    assert result.proposals.count.tolist() == [4, 3]
    assert result.state_names == STATES
    np.testing.assert_array_equal(result.T_world_sensor, PLACED)
    assert set(pipe.ledger.close_frame(7)["stages"]) == set(STAGES)


def test_without_a_selection_nothing_is_classified():
    stages = Stages(choose=lambda asks, budget: [])
    pipe = pipeline(stages)
    result = pipe.step(FRAME)
    assert {"classify", "fuse"}.isdisjoint(call[0] for call in stages.calls)
    assert [call for call in stages.calls if call[0] in {"decide", "conclude"}] == [("decide",), ("conclude", [], [])]
    assert (len(result.classified), result.n_deferred) == (0, 2)
    assert CLASSIFICATION not in pipe.ledger.close_frame(7)["stages"]


@pytest.mark.parametrize(
    ("budget", "learns"), [(Budget(calls=5), False), (Budget(cpu_ms=9.0), True), (Budget(mean_ms=9.0), True)]
)
def test_points_are_counted_and_the_cost_model_learns_where_cpu_time_binds(budget, learns):
    stages, cpu_ns = Stages(), count(0, 250_000)
    pipe = replace(pipeline(stages), ledger=Ledger(cpu_ns=lambda: next(cpu_ns)))
    pipe.step(FRAME, budget)
    assert [call for call in stages.calls if call[0] == "paid"] == [("paid", [3, 4], 0.25)] * learns
    row = pipe.ledger.close_frame(7)["stages"][CLASSIFICATION]
    assert (row["calls"], row["items"], row["points"]) == (1, 2, 70)


BOOKED = {"segment": SEGMENTATION, "locate": ODOMETRY, "follow": TRACKING, "asks": FUSION, "select": SCHEDULING}
BOOKED |= {"classify": CLASSIFICATION, "fuse": FUSION, "conclude": TRACKING}


@pytest.mark.parametrize(("call", "stage"), BOOKED.items())
def test_every_call_is_booked_on_its_stage_even_if_it_fails(call, stage):
    def fail(*arguments):
        raise ZeroDivisionError

    failing = Stages()
    setattr(failing, call, fail)
    pipe = pipeline(failing)
    with pytest.raises(ZeroDivisionError):
        pipe.step(FRAME)
    booked = pipe.ledger.close_frame(7)["stages"]
    assert booked[stage]["calls"] == 1 + (call in {"fuse", "conclude"})
    assert set(booked) <= set(STAGES)
