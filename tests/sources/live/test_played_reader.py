"""A recording plays at its own pace, once or for ever."""

import numpy as np
import pytest

from modt.sources.live.live_stream import PlayedReader, PlayedSince
from modt.sources.stream import Faults, Reading, StreamEndedError, StreamInfo
from modt.types import Frame


class Recording(list):
    info = StreamInfo("recording", "test", n_frames=3)
    faults = Faults()
    reading = Reading()


class Time:
    def __init__(self):
        self.now = 50.0

    def wait(self, seconds):
        self.now += seconds
        return False


def recording(stamps):
    return Recording(Frame(i, s, np.full((3, 4), i, np.float32), turn_s=0.1) for i, s in enumerate(stamps))


def played(stamps, n, **options):
    """Times at which the first n sweeps of a recording are read, their stamps and numbers, and the reader."""
    time = Time()
    out = []
    reader = PlayedReader(recording(stamps), clock=lambda: time.now, wait=time.wait, **options)
    while len(out) < n:
        out += [(round(time.now - 50.0, 6), round(s.stamp_s, 6), s.index) for s in reader.read(0.2)]
    return out, reader


def test_sweeps_come_at_the_pace_of_their_stamps():
    out, reader = played([7.0, 7.1, 8.5], 3)
    assert out == [(0.0, 7.0, 0), (0.1, 7.1, 1), (1.5, 8.5, 2)]
    with pytest.raises(StreamEndedError):
        reader.read(0.2)


def test_recordings_that_are_played_together_keep_the_time_between_them():
    since = PlayedSince()
    before, _ = played([0.0, 0.1], 2, since=since)
    after, _ = played([0.0, 0.1], 2, later_s=0.5, since=since)
    assert [due_s for due_s, *_ in before + after] == [0.0, 0.1, 0.5, 0.6]
    assert [stamp_s for _, stamp_s, _ in after] == [0.5, 0.6]


def test_a_loop_goes_on_with_rising_stamps():
    out, _ = played([7.0, 7.1], 5, loop=True)
    assert out == [(k / 10, pytest.approx(7.0 + k / 10), None) for k in range(5)]


def test_a_loop_over_nothing_ends_and_closing_ends_the_wait():
    with pytest.raises(StreamEndedError):
        PlayedReader(recording([]), loop=True).read(0.2)
    reader = PlayedReader(recording([0.0, 100.0]))
    assert len(reader.read(0.2)) == 1
    reader.close()
    with pytest.raises(StreamEndedError):
        reader.read(0.2)
