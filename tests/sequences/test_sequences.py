"""The promises of a pipeline, under a few sequences; `python -m tools.sequences` makes many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, settings

from modt.types import UNLIMITED, Frame
from tests.sequences.machine import Sequences
from tests.sequences.promises import Run, config

TestSequences = pytest.mark.slow(Sequences.TestCase)
TestSequences.settings = settings(max_examples=40, stateful_step_count=15, phases=(Phase.generate,))


def test_a_clock_that_creeps_keeps_no_track_alive_for_ever():
    run = Run("accurate", config("vlp-16", "kdop"), UNLIMITED)
    rng = np.random.default_rng(1)
    for index in range(40):
        points = np.repeat(rng.uniform(-40, 40, (15, 4)), 20, axis=0) + rng.uniform(0, 0.4, (300, 4))
        points[:, 2] = rng.uniform(-0.8, 0.8, 300)
        alive = len(run.step(Frame(index, 1e-9 * index, points.astype(np.float32), np.eye(4))).tracks)
    assert 100 < alive <= sum(run.proposals[-run.config.tracking.max_missed - 2 :])


def test_half_a_million_points_are_a_frame_like_any_other():
    run = Run("accurate", config("hdl-64e", "kdop"), UNLIMITED)
    rng = np.random.default_rng(1)
    points = rng.uniform(-80, 80, (500_000, 4)) * [1, 1, 0.03, 0.0]
    assert len(run.step(Frame(0, 0.0, points.astype(np.float32))).frame.points) == 500_000
    run.step(Frame(1, 0.1, np.zeros((0, 4), np.float32)))
