"""Lateness, execution and latency against deadlines."""

import pytest

from modt.app.deadlines import Deadlines, Timing


def test_a_frame_is_missed_when_its_result_comes_after_the_next_sweep():
    timing = Timing()
    assert timing.add(10.0, 10.001, 10.05, 0.1) == pytest.approx(0.5)
    assert timing.add(10.1, 10.15, 10.21, 0.1) == pytest.approx(1.1)
    report = timing.report()
    assert (report["frames"], report["missed_deadlines"]) == (2, 1)
    assert report["lateness_ms"]["max"] == pytest.approx(50.0)
    assert report["execution_ms"]["max"] == pytest.approx(60.0)
    assert report["latency_ms"]["max"] == pytest.approx(110.0)


def line(**ms):
    return {"stages": {stage: {"wall_ns": int(1e6 * value)} for stage, value in ms.items()}}


def test_the_cost_of_the_rest_rises_at_once_and_falls_slowly():
    deadlines = Deadlines(0.1, lambda: 0.0)

    def rest_ms(**ms):
        deadlines.finish(0.0, line(**ms))
        return deadlines.report()["other_stages_ms"]

    assert rest_ms(segmentation=10, tracking=5, classification=50) == pytest.approx(15)
    assert rest_ms(segmentation=30) == pytest.approx(30)
    assert 28 < rest_ms(segmentation=10) < 30
    for _ in range(200):
        last_ms = rest_ms(segmentation=10)
    assert last_ms == pytest.approx(10, rel=0.01)
