"""Sweeps of another size are noticed when they stay."""

import numpy as np

from modt.app.stages import SWEEPS, SensorWatch


def sweep(returns):
    points = np.zeros((1000, 4), np.float32)
    points[:returns, 0] = 5.0
    return points


def noticed(sizes):
    watch = SensorWatch()
    return [k for k, size in enumerate(sizes) if watch.unlike(sweep(size))]


def test_a_change_is_noticed_once_after_some_sweeps():
    assert noticed([800] * 20 + [200] * 30) == [20 + SWEEPS - 1]
    assert noticed([200] * 20 + [800] * 30) == [20 + SWEEPS - 1]


def test_what_does_not_stay_or_is_gradual_is_not_noticed():
    assert noticed(([800] * 5 + [100] * (SWEEPS - 1)) * 5) == []
    assert noticed([0] * 50) == []
    assert noticed(np.linspace(800, 500, 200).astype(int).tolist()) == []
