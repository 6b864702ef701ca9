"""Pace, stop and the order of things in the loop."""

import json
import os
import signal
import socket

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.app.containment import Containment
from modt.app.deadlines import NoDeadlines
from modt.app.loop import NAP_S, Loop, Stop
from modt.app.playback import Pace, Playback
from modt.app.supervisor import Supervisor
from modt.config import OdometryConfig
from modt.energy.ledger import Ledger
from modt.sources.pose_socket import PoseSocket
from modt.sources.stream import Faults, StreamInfo
from modt.types import Budget, Frame
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


def test_frames_start_at_absolute_deadlines():
    out, pace = starts([0.03, 0.09, 0.0, 0.05])
    assert out == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert pace.report()["missed_deadlines"] == 0


def test_a_stall_is_counted_and_no_burst_follows():
    out, pace = starts([0.35, 0.01, 0.01, 0.01])
    assert out == pytest.approx([0.0, 0.35, 0.45, 0.55])
    assert pace.report()["missed_deadlines"] == 2
    assert pace.report()["max_lateness_ms"] == pytest.approx(250)  # the stall is not hidden by starting anew


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_frames_never_start_early_nor_in_a_burst(work):
    out, pace = starts(work)
    for i, first in enumerate(out):
        for steps, later in enumerate(out[i:]):
            assert later - first >= (steps - 1) * 0.1 - 1e-6  # one frame at most is made up for, never a row of them
    assert pace.report()["missed_deadlines"] >= sum(w > 0.21 for w in work[:-1])


class Stages:
    ledger, budget = Ledger(), Budget(7)

    def __init__(self):
        self.seen, self.recognised = [], []

    def recognise(self, frame, named):
        self.recognised.append(frame.index)

    def step(self, frame, budget, *, reduced):
        self.seen.append((frame.index, budget, reduced))
        return result(frame.index, [3], {0: 1})

    def watch(self, frame):
        pass


class Frames(list):
    info = StreamInfo("frames", "made up", 0, 4, 0.125, None, False)
    faults = Faults()


def replay(stages, sinks, stop=None, observe=lambda r, line: None, pace=None, frames=()):
    """Play frames through stages, to the end or a signal."""
    source = Playback(Frames(frames), pace or Pace(), stages.ledger)
    sinks = {f"sink {k}": sink for k, sink in enumerate(sinks)}
    deadlines, contained = NoDeadlines(Pace().report), Containment(contains=False)
    loop = Loop(source, stages, sinks, observe, lambda supervisor: None, deadlines, contained, stop or Stop())
    loop.run(Supervisor())


def made(n=9):
    return [result(i, [], {}).frame for i in range(n)]


def test_every_frame_reaches_every_sink_and_the_observer():
    stages, sinks, observed = Stages(), [Kept(), Kept()], []
    replay(stages, sinks, observe=lambda r, line: observed.append(line), frames=made(4))
    assert [s.indices for s in sinks] == [[0, 1, 2, 3]] * 2
    assert [line["frame"] for line in observed] == [0, 1, 2, 3]
    assert stages.seen == [(i, Budget(7), False) for i in range(4)]
    assert stages.recognised == [0]


def test_a_failure_of_a_replay_is_not_contained():
    class Broken(Kept):
        def write(self, r):
            raise ConnectionError("gone")

    with pytest.raises(ConnectionError):
        replay(Stages(), [Broken()], frames=made())

    class Failing(Stages):
        def step(self, frame, budget, *, reduced):
            raise IndexError("a bug")

    with pytest.raises(IndexError):
        replay(Failing(), [], frames=made())


class Sender(Time):
    """Time in which another process says where the sensor is whenever the loop has slept."""

    def __init__(self, out):
        super().__init__()
        self.out = out

    def sleep(self, seconds):
        super().sleep(seconds)
        stamp_s = self.now - 100.0
        self.out.send(json.dumps({"stamp": stamp_s, "x": 8 * stamp_s, "y": 0.0, "yaw": 0.0}).encode())


def test_poses_received_while_waiting_apply_to_the_next_frame():
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    time, placed = Sender(there), []
    poses = PoseSocket(here, OdometryConfig(), "test")

    class Placed(Stages):
        def step(self, frame, budget, *, reduced):
            frame = poses.place(frame)
            placed.append(None if frame.T_world_sensor is None else frame.T_world_sensor[0, 3])
            return super().step(frame, budget, reduced=reduced)

    frames = [Frame(i, 0.125 * i, np.zeros((0, 4), np.float32)) for i in range(4)]
    replay(Placed(), [], pace=Pace(8.0, time, time.sleep), frames=frames)
    assert placed == [None, 1.0, 2.0, 3.0]
    there.close()
    poses.close()


def test_a_signal_ends_the_loop_after_the_frame_in_hand():
    sink = Kept()

    def interrupt(r, line):
        if r.frame.index == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with Stop().on_signals() as stop:
        replay(Stages(), [sink], stop, interrupt, frames=made())
    assert sink.indices == [0, 1, 2]
    assert stop.signal == "SIGINT"


def test_a_signal_ends_a_long_sleep_within_a_nap():
    time, naps = Time(), []

    def nap(seconds):
        naps.append(seconds)
        time.sleep(seconds)
        if len(naps) == 3:
            os.kill(os.getpid(), signal.SIGTERM)

    with Stop(nap, time).on_signals() as stop:
        stop.sleep(100.0)
    assert len(naps) == 3
    assert max(naps) <= NAP_S


def test_naps_do_not_add_up_to_more_than_the_sleep():
    time = Time()
    stop = Stop(lambda seconds: time.sleep(seconds + 0.003), time)
    stop.sleep(1.0)
    assert time.now == pytest.approx(101.0, abs=0.004)


def test_a_reload_is_asked_for_once_by_a_signal():
    with Stop(reload=True).on_signals() as stop:
        assert not stop.take_reload()
        os.kill(os.getpid(), signal.SIGHUP)
        assert stop.take_reload()
        assert not stop.take_reload()
        assert stop.signal is None
