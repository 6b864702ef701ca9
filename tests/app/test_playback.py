"""Pace of a replay, and the signals that end its sleep."""

import os
import signal
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.app.playback import Playback
from modt.app.stop import NAP_S, Stop
from modt.energy.ledger import Ledger
from modt.sources.stream import StreamEndedError


class Time:
    """A clock that only sleeping and working move."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        assert seconds > 0
        self.now += seconds


class Frames(list):
    info, faults = SimpleNamespace(profile=None), None


def starts(work, period=0.1):
    """Times at which frames begin that take so long, and the playback after the last one."""
    time, out = Time(), list[float]()
    playback = Playback(Frames(work), Ledger(), 1 / period, time.sleep, time)
    for _ in work:
        seconds = playback.take(0.0).frame
        out.append(time.now - 100.0)
        time.now += seconds
    with pytest.raises(StreamEndedError):
        playback.take(0.0)
    return out, playback


@pytest.mark.parametrize(
    ("work", "begins", "missed", "late_ms"),
    [
        ([0.03, 0.09, 0.0, 0.05], [0.0, 0.1, 0.2, 0.3], 0, 0),
        ([0.35, 0.01, 0.01, 0.01], [0.0, 0.35, 0.45, 0.55], 2, 250),
    ],
    ids=["in time", "a stall, without a burst after it"],
)
def test_frames_start_at_absolute_deadlines_and_a_stall_is_counted(work, begins, missed, late_ms):
    out, playback = starts(work)
    assert out == pytest.approx(begins)
    assert playback.report()["missed_deadlines"] == missed
    assert playback.report()["max_lateness_ms"] == pytest.approx(late_ms)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_frames_never_start_early_nor_in_a_burst(work):
    out, playback = starts(work)
    for i, first in enumerate(out):
        for steps, later in enumerate(out[i:]):
            assert later - first >= (steps - 1) * 0.1 - 1e-6  # one frame at most is made up for, never a row of them
    assert playback.report()["missed_deadlines"] >= sum(w > 0.21 for w in work[:-1])


def test_a_signal_ends_a_long_sleep_of_naps_that_add_up_to_it():
    time, naps = Time(), []

    def nap(seconds):
        naps.append(seconds)
        time.sleep(seconds + 0.003)
        if len(naps) == 30:
            os.kill(os.getpid(), signal.SIGTERM)

    with Stop(nap, time).on_signals() as stop:
        stop.sleep(1.0)
        assert time.now == pytest.approx(101.0, abs=0.004)
        stop.sleep(100.0)
    assert len(naps) == 30
    assert max(naps) <= NAP_S
