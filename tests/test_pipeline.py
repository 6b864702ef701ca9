"""The step: what each stage is handed and booked with; golden replays hold what comes out."""

from collections import Counter
from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

from modt.app import assembly
from modt.energy.ledger import Ledger
from modt.geometry import FieldOfView
from modt.pipeline import CLASSIFICATION, FUSION, ODOMETRY, SCHEDULING, SEGMENTATION, STAGES, TRACKING
from modt.profile import load
from modt.types import NONE, Budget
from modt_desk.simulation.synthetic_stream import SyntheticStream

FRAMES = list(SyntheticStream("street", "vlp-16", 0.4, seed=3))
CALLS = {
    "segmenter.segment": SEGMENTATION,
    "odometry.locate": ODOMETRY,
    "tracker.follow": TRACKING,
    "fusion.asks": FUSION,
    "scheduler.select": SCHEDULING,
    "classifier.classify": CLASSIFICATION,
    "fusion.fuse": FUSION,
    "decision.decide": FUSION,
    "tracker.conclude": TRACKING,
}
"""Calls of a step, in order, and the stages that they are booked on."""


@pytest.fixture(name="pipe")
def a_pipeline_that_has_seen_three_frames():
    pipe = assembly.pipeline(assembly.MODES["accurate"], load("vlp-16"), FieldOfView())
    for frame in FRAMES[:3]:
        pipe.step(frame)
        pipe.ledger.close_frame(frame.index)
    return pipe


class Spy:
    """A stage whose calls are recorded by their names, with arguments and results."""

    def __init__(self, stage, name, calls):
        self._stage, self._name, self._calls = stage, name, calls

    def __getattr__(self, name):
        there, called = getattr(self._stage, name), f"{self._name}.{name}"
        if called not in CALLS:
            return there

        def call(*arguments):
            result = there(*arguments)
            self._calls[called] = SimpleNamespace(arguments=arguments, result=result)
            return result

        return call


def spied(pipe):
    """The pipeline, and the calls that it will make."""
    calls = {}
    names = {called.partition(".")[0] for called in CALLS}
    return replace(pipe, **{name: Spy(getattr(pipe, name), name, calls) for name in names}), calls


def test_every_stage_has_what_the_one_before_it_made(pipe):
    pipe, calls = spied(pipe)
    result = pipe.step(FRAMES[3], Budget(calls=5))
    assert list(calls) == list(CALLS)
    rows, certain = calls["tracker.conclude"].arguments
    np.testing.assert_array_equal(rows, calls["scheduler.select"].result.rows)
    np.testing.assert_array_equal(certain, calls["fusion.fuse"].result)
    tracked = calls["tracker.follow"].result
    points, proposals, which = calls["classifier.classify"].arguments
    assert points is FRAMES[3].points
    assert proposals is result.proposals is tracked.proposals
    np.testing.assert_array_equal(which, tracked.tracks.proposal[rows])
    assert NONE not in which
    assert 0 < len(result.classified) == len(rows) <= 5
    assert result.n_deferred == calls["scheduler.select"].result.deferred
    booked = pipe.ledger.close_frame(3)["stages"]
    assert {stage: row["calls"] for stage, row in booked.items()} == Counter(CALLS.values())
    assert set(booked) == set(STAGES)


def test_without_a_selection_nothing_is_classified(pipe):
    pipe, calls = spied(pipe)
    result = pipe.step(FRAMES[3], Budget(calls=0))
    assert list(calls) == [name for name in CALLS if name not in {"classifier.classify", "fusion.fuse"}]
    assert len(result.classified) == 0 < result.n_deferred
    assert CLASSIFICATION not in pipe.ledger.close_frame(3)["stages"]


@pytest.mark.parametrize(
    ("budget", "learns"), [(Budget(calls=5), False), (Budget(cpu_ms=9.0), True), (Budget(mean_ms=9.0), True)]
)
def test_points_are_counted_and_the_cost_model_learns_where_cpu_time_binds(pipe, budget, learns, monkeypatch):
    paid, cpu_ns = [], count(0, 250_000)
    monkeypatch.setattr(pipe.scheduler, "paid", lambda points, cpu_ms: paid.append((points.tolist(), cpu_ms)))
    pipe, calls = spied(replace(pipe, ledger=Ledger(cpu_ns=lambda: next(cpu_ns))))
    pipe.step(FRAMES[3], budget)
    _, proposals, which = calls["classifier.classify"].arguments
    assert paid == [(proposals.count[which].tolist(), 0.25)] * learns
    row = pipe.ledger.close_frame(3)["stages"][CLASSIFICATION]
    size = pipe.scheduler.cost.size(proposals.count[which])
    assert (row["calls"], row["items"], row["points"]) == (1, len(which), size)
