"""The step: what it books on each stage, and what the scheduler learns; golden replays hold what comes out."""

from itertools import count

import numpy as np
import pytest

from modt.app import assembly
from modt.energy.ledger import Ledger
from modt.geometry import FieldOfView
from modt.pipeline import CLASSIFICATION, FUSION, ODOMETRY, SCHEDULING, SEGMENTATION, TRACKING
from modt.profile import load
from modt.types import Budget
from modt_simulation.synthetic_stream import SyntheticStream

FRAMES = list(SyntheticStream("street", "vlp-16", 0.4, seed=3))
BOOKED = {SEGMENTATION: 1, ODOMETRY: 1, TRACKING: 3, FUSION: 4, SCHEDULING: 1, CLASSIFICATION: 1}
"""Calls of a step that classifies."""


@pytest.fixture(name="pipe")
def a_pipeline_that_has_seen_three_frames():
    cpu_ns = count(0, 250_000)
    ledger = Ledger(cpu_ns=lambda: next(cpu_ns))
    pipe = assembly.pipeline(assembly.MODES["accurate"], load("vlp-16"), FieldOfView(), ledger)
    for frame in FRAMES[:3]:
        pipe.step(frame)
        pipe.ledger.close_frame(frame.index)
    return pipe


def calls(pipe):
    return {stage: work.calls for stage, work in pipe.ledger.close_frame(3).stages.items()}


def test_every_call_is_booked_on_its_stage_and_the_budget_binds(pipe):
    result = pipe.step(FRAMES[3], Budget(calls=5))
    assert calls(pipe) == BOOKED
    assert 0 < len(result.classified) <= 5


def test_stages_write_no_column_of_another(pipe):
    """The stages hand proposals and each other's columns on read-only."""
    result = pipe.step(FRAMES[3])
    tracks = pipe.tracker.tracks
    for column in (tracks.posterior, tracks.waiting, tracks.object_class, result.tracks.x, result.proposals.box):
        with pytest.raises(ValueError, match="read-only"):
            column[:] = 0


def test_without_a_selection_nothing_is_classified(pipe):
    result = pipe.step(FRAMES[3], Budget(calls=0))
    assert calls(pipe) == {stage: n for stage, n in (BOOKED | {FUSION: 3}).items() if stage != CLASSIFICATION}
    assert len(result.classified) == 0 < result.n_deferred


@pytest.mark.parametrize(
    ("budget", "learns"), [(Budget(calls=5), False), (Budget(cpu_ms=9.0), True), (Budget(mean_ms=9.0), True)]
)
def test_points_are_counted_and_the_cost_model_learns_where_cpu_time_binds(pipe, budget, learns, monkeypatch):
    paid = []
    monkeypatch.setattr(pipe.scheduler, "record_cost", lambda points, cpu_ms: paid.append((sorted(points), cpu_ms)))
    result = pipe.step(FRAMES[3], budget)
    classified = np.isin(result.tracks.id, result.classified)
    points = result.proposals.count[result.tracks.proposal[classified]]
    assert paid == [(sorted(points), 0.25)] * learns
    work = pipe.ledger.close_frame(3).stages[CLASSIFICATION]
    assert (work.calls, work.items, work.points) == (1, len(points), pipe.scheduler.cost.size(points))
