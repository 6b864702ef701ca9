"""Benchmarks of a frame and of the classifier."""

import numpy as np
import pytest

from modt.types import Frame
from tests.classification.scenes import blobs
from tools.bench import frame


def times(**ms):
    return {frame.YARDSTICK: np.full(20, 4.0), **{name: np.full(20, v) for name, v in ms.items()}}


def test_a_regression_is_more_of_the_yardsticks_time():
    earlier = frame.summary(times(accurate=8.0, efficient=6.0))
    later = frame.summary({name: 3 * ms for name, ms in times(accurate=8.0, efficient=9.0).items()})
    assert frame.regressions(later, earlier, 0.2) == ["efficient: +50% of the yardstick's time"]
    assert frame.regressions(later, earlier, 0.6) == []


def test_the_first_frames_are_left_out_and_all_run_on_each_in_random_order():
    seen = []

    def work(name):
        return lambda sweep: seen.append((name, sweep.index)) or float(sweep.index)

    sweeps = [Frame(i, 0.1 * i, np.zeros((0, 4), np.float32), None) for i in range(frame.FIRST + 2)]
    found = frame.measure(sweeps, {name: work(name) for name in ("one", f"{frame.PART} (one)", "other")})
    assert found["one"].tolist() == [frame.FIRST, frame.FIRST + 1]
    orders = [tuple(name for name, index in seen if index == i) for i in range(len(sweeps))]
    part = f"{frame.PART} (one)"
    assert set(orders) == {("one", "other", part), ("other", "one", part)}


def test_the_textbook_graph_equals_the_exported_one():
    pytest.importorskip("onnx", reason="extra [train] is not installed")
    from modt.classification.pointnet import PointNet
    from modt.config import ClassificationConfig, SensorConfig
    from tools.bench.classification import bare, textbook

    shipped = PointNet(ClassificationConfig(), SensorConfig())
    naive, ours = (bare(shipped, SensorConfig(), pool_first=first) for first in (False, True))
    points, proposals = blobs([6, 40, 128], np.random.default_rng(1))
    expected = ours.classify(points, proposals, np.arange(3))
    np.testing.assert_allclose(textbook(naive, points, proposals, 2, SensorConfig()), expected, atol=1e-5)
