"""Pace of a replay, and the signals that stop it."""

import os
import signal
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.app.containment import Containment
from modt.app.deadlines import NoDeadlines
from modt.app.playback import Pace, Playback
from modt.app.session import Session
from modt.app.stop import NAP_S, Stop
from modt.app.supervisor import Supervisor
from modt.energy.ledger import Ledger
from modt.sources.stream import Faults, StreamInfo
from modt.types import Budget
from tests.results import Kept, result


class Time:
    """A clock that only sleeping and working move."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        assert seconds > 0
        self.now += seconds


def starts(work, period=0.1):
    time = Time()
    pace = Pace(1 / period, time, time.sleep)
    out = []
    for seconds in work:
        pace.wait()
        out.append(time.now - 100.0)
        time.now += seconds
    return out, pace


@pytest.mark.parametrize(
    ("work", "begins", "missed", "late_ms"),
    [
        ([0.03, 0.09, 0.0, 0.05], [0.0, 0.1, 0.2, 0.3], 0, 0),
        ([0.35, 0.01, 0.01, 0.01], [0.0, 0.35, 0.45, 0.55], 2, 250),
    ],
    ids=["in time", "a stall, without a burst after it"],
)
def test_frames_start_at_absolute_deadlines_and_a_stall_is_counted(work, begins, missed, late_ms):
    out, pace = starts(work)
    assert out == pytest.approx(begins)
    assert pace.report()["missed_deadlines"] == missed
    assert pace.report()["max_lateness_ms"] == pytest.approx(late_ms)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_frames_never_start_early_nor_in_a_burst(work):
    out, pace = starts(work)
    for i, first in enumerate(out):
        for steps, later in enumerate(out[i:]):
            assert later - first >= (steps - 1) * 0.1 - 1e-6  # one frame at most is made up for, never a row of them
    assert pace.report()["missed_deadlines"] >= sum(w > 0.21 for w in work[:-1])


def stages_of(step=lambda frame, budget, *, reduced: result(frame.index, [3], {0: 1})):
    return Mock(ledger=Ledger(), budget=Budget(7), step=Mock(side_effect=step))


class Frames(list):
    info = StreamInfo("frames", "made up", 0, 4, 0.125, None, False)
    faults = Faults()


def replay(stages, sink, stop=None, observe=lambda r, line: None):
    """Play nine frames through stages, to the end or a signal."""
    source = Playback(Frames(result(i, [], {}).frame for i in range(9)), Pace(), stages.ledger)
    deadlines, contained = NoDeadlines(Pace().report), Containment(contains=False)
    session = Session(source, stages, Mock(), {"sink": sink}, deadlines, contained, stop or Stop(), (), None)
    session._observe = observe
    session.follow(Supervisor())


@pytest.mark.parametrize("broken", ["stages", "sink"])
def test_a_failure_of_a_replay_is_not_contained(broken):
    failing = Mock(side_effect=ConnectionError("gone"))
    stages, sink = (stages_of(failing), Kept()) if broken == "stages" else (stages_of(), Mock(write=failing))
    with pytest.raises(ConnectionError):
        replay(stages, sink)


def test_a_signal_ends_the_loop_after_the_frame_in_hand():
    stages, sink, lines = stages_of(), Kept(), []

    def interrupt(r, line):
        lines.append(line["frame"])
        if r.frame.index == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with Stop().on_signals() as stop:
        replay(stages, sink, stop, interrupt)
    assert sink.indices == lines == [0, 1, 2]
    assert [made.args[1] for made in stages.step.call_args_list] == [Budget(7)] * 3
    assert stages.recognise.call_count == 1
    assert stop.signal == "SIGINT"


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


def test_a_reload_is_asked_for_once_by_a_signal():
    with Stop(reload=True).on_signals() as stop:
        assert not stop.take_reload()
        os.kill(os.getpid(), signal.SIGHUP)
        assert stop.take_reload()
        assert not stop.take_reload()
        assert stop.signal is None
