"""The promises of the live inputs, under a few sequences; `python -m tools.sequences --live` makes many."""

from __future__ import annotations

import pytest
from hypothesis import Phase, settings

pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
from tests.sequences.live_machine import LiveSequences
from tests.sequences.live_world import LiveWorld

TestLiveSequences = pytest.mark.slow(LiveSequences.TestCase)
TestLiveSequences.settings = settings(
    max_examples=15, stateful_step_count=12, phases=(Phase.generate,), derandomize=True
)


@pytest.mark.parametrize(("step_s", "counted"), [(-100.0, 1), (-0.5, 1), (59.0, 1), (0.0, 0)])
def test_a_leap_of_the_stamps_costs_a_turn_which_is_counted(step_s, counted):
    world = LiveWorld("velodyne", "datagrams")
    world.drive(5)
    world.sensor_s += step_s
    world.drive(5)
    world.now_s += 5.0  # a sensor that was off is none
    world.drive(5)
    world.close()
    assert sum(world.stream.health()["refused_messages"].values()) == counted
    assert world.stream.sweeps == 15 - 2 * (2 + counted)
