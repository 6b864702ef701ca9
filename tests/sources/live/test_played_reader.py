"""A recording plays at its own pace, once or for ever."""

import numpy as np
import pytest

from modt.sources.live.live_stream import PlayedReader
from modt.sources.stream import Faults, StreamEndedError, StreamInfo
from modt.types import Frame


class Recording(list):
    info = StreamInfo("recording", "test", 0, 3, 0.1, None, False)
    faults = Faults()


class Time:
    def __init__(self):
        self.now = 50.0

    def wait(self, seconds):
        self.now += seconds
        return False


def recording(stamps):
    return Recording(Frame(i, s, np.full((3, 4), i, np.float32), turn_s=0.1) for i, s in enumerate(stamps))


def played(reader, time, n):
    out = []
    while len(out) < n:
        out += [(round(time.now - 50.0, 6), sweep) for sweep in reader.read(0.2)]
    return out


def test_sweeps_come_at_the_pace_of_their_stamps():
    time = Time()
    reader = PlayedReader(recording([7.0, 7.1, 8.5]), clock=lambda: time.now, wait=time.wait)
    out = played(reader, time, 3)
    assert [at for at, _ in out] == [0.0, 0.1, 1.5]
    assert [sweep.stamp_s for _, sweep in out] == [7.0, 7.1, 8.5]
    assert [sweep.points[0, 0] for _, sweep in out] == [0, 1, 2]
    assert [sweep.index for _, sweep in out] == [0, 1, 2]
    with pytest.raises(StreamEndedError):
        reader.read(0.2)


def test_a_loop_goes_on_with_rising_stamps():
    time = Time()
    reader = PlayedReader(recording([7.0, 7.1]), loop=True, clock=lambda: time.now, wait=time.wait)
    out = played(reader, time, 5)
    assert [round(sweep.stamp_s, 6) for _, sweep in out] == [7.0, 7.1, 7.2, 7.3, 7.4]
    assert [at for at, _ in out] == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert {sweep.index for _, sweep in out} == {None}


def test_a_loop_over_nothing_ends():
    with pytest.raises(StreamEndedError):
        PlayedReader(recording([]), loop=True).read(0.2)


def test_closing_ends_the_wait():
    reader = PlayedReader(recording([0.0, 100.0]))
    assert len(reader.read(0.2)) == 1
    reader.close()
    with pytest.raises(StreamEndedError):
        reader.read(0.2)
