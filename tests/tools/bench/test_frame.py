"""Benchmark of a frame."""

import numpy as np

from modt.types import Frame
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
