"""The benchmark of a frame."""

import numpy as np

from modt.types import Frame
from tools.bench import frame


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
