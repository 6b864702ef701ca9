"""The loop over a live source, on a clock that only working and waiting move."""

import logging
import signal

import numpy as np
import pytest

from modt.app.containment import MAX_IN_A_ROW, RENEW_AFTER, Containment, OncePerSecond
from modt.app.deadlines import Deadlines
from modt.app.ladder import Step
from modt.app.loop import WAIT_S, Loop, Stop
from modt.errors import MisuseError, ModtError
from modt.sources.stream import Received, StreamEndedError
from modt.types import Budget, Frame
from tests.results import Kept, result

POINTS = np.zeros((1, 4), np.float32)


class Time:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Sensor:
    """A sweep every 0.1 s until an end; the newest one is taken, as from a LiveStream."""

    def __init__(self, time, seconds, silent=(0.0, 0.0)):
        self.time, self.end, self.profile = time, 100.0 + seconds, "vlp-16"
        self.silent, self.taken, self.dropped = silent, 0, 0

    def take(self, timeout_s):
        due = 100.0 + 0.1 * (self.taken + 1)
        if self.silent[0] <= due - 100.0 < self.silent[1]:
            self.taken += 1
            return self.take(timeout_s)
        if due > self.end:
            raise StreamEndedError
        if due > self.time.now + timeout_s:
            self.time.now += timeout_s
            return None
        while 100.0 + 0.1 * (self.taken + 2) <= self.time.now:
            self.taken, self.dropped = self.taken + 1, self.dropped + 1
            due = 100.0 + 0.1 * (self.taken + 1)
        self.taken += 1
        self.time.now = max(self.time.now, due)
        return Received(Frame(self.taken, due, POINTS), due)


class Stages:
    budget = Budget(16, None)

    def __init__(self, time, work_s):
        self.time, self.work_s, self.ledger = time, work_s, self
        self.recognised, self.watched = [], []
        self.steps, self.recovered, self.loads = [], [], 0
        self.invalid = None

    def step(self, frame, budget, *, reduced):
        self.steps.append((frame.index, budget, reduced))
        self.time.now += self.work_s(self.time.now - 100.0)
        return result(frame.index, [3], {0: 1})

    def recognise(self, frame, named):
        self.recognised.append((frame.index, named))

    def watch(self, frame):
        self.watched.append(frame.index)

    def run(self, stage, write, r):
        write(r)

    def close_frame(self, index):
        return {"frame": index, "stages": {"segmentation": {"wall_ns": 20_000_000}}}

    def recover(self, *, anew):
        self.recovered.append(anew)

    def reload(self):
        if self.invalid:
            raise self.invalid
        self.loads += 1


class Told:
    """A supervisor that notes what it is told, and when."""

    def __init__(self, time):
        self.time, self.said, self.pings = time, [], []

    def ready(self):
        self.said.append("ready")

    def reloading(self):
        self.said.append("reloading")

    def alive(self):
        self.pings.append(self.time.now)


def loop_of(seconds, work=lambda t: 0.02, sinks=(), stages=None, silent=(0.0, 0.0), stop=None):
    time = Time()
    sensor, stages = Sensor(time, seconds, silent), (stages or Stages)(time, work)
    told, reports, seen = Told(time), [], []
    loop = Loop(
        sensor,
        stages,
        {f"sink {k}": sink for k, sink in enumerate(sinks)},
        lambda r, line: seen.append(r.frame.index),
        lambda supervisor: reports.append(time.now),
        Deadlines(0.1, time),
        Containment(),
        stop or Stop(),
        time,
    )
    run = loop.run
    loop.run, loop.deadlines, loop.failures = lambda: run(told), loop._deadlines, loop._failures
    return loop, sensor, stages, told, reports, seen


def test_every_sweep_in_time_goes_through():
    sink = Kept()
    loop, sensor, stages, told, reports, seen = loop_of(10.0, sinks=[sink])
    loop.run()
    assert len(seen) == 100
    assert sink.indices == seen
    assert loop.deadlines.timing.missed == sensor.dropped == loop.deadlines.shed == 0
    assert loop.deadlines.report()["lateness_ms"]["max"] == 0.0
    assert stages.recognised == [(1, "vlp-16")]
    assert stages.watched == seen
    assert loop.deadlines.timing.report()["latency_ms"]["max"] == pytest.approx(20.0)
    assert told.said == ["ready"]
    assert len(reports) in (10, 11)


def test_the_budget_is_what_is_left_to_the_deadline():
    loop, _, stages, *_ = loop_of(1.0)
    loop.run()
    assert stages.steps[-1][1] == Budget(16, pytest.approx(80.0))


def test_the_watchdog_is_served_while_the_sensor_is_silent():
    loop, _, _, told, _, seen = loop_of(12.0, silent=(1.0, 11.0))
    loop.run()
    gaps = np.diff(told.pings)
    assert max(gaps) <= WAIT_S + 0.11
    assert 15 < len(seen) < 25


def hog(begin, end, work_s):
    return lambda t: work_s if begin <= t < end else 0.02


def test_under_load_the_loop_sheds_and_is_back_within_a_second(caplog):
    loop, _, stages, _, _, _ = loop_of(10.0, hog(2.0, 5.0, 0.15))
    changed = []
    loop.deadlines.ladder.frame, real = (lambda now, share: note(real(now, share), now)), loop.deadlines.ladder.frame

    def note(change, now):
        if change is not None:
            changed.append((now - 100.0, loop.deadlines.ladder.step))
        return change

    with caplog.at_level(logging.WARNING):
        loop.run()
    assert [step for _, step in changed[:3]] == [Step.DEFERRED, Step.REDUCED, Step.DROPPED]
    last, step = changed[-1]
    assert step is Step.ALL
    assert last < 5.0 + 0.15 + 1.01
    assert loop.deadlines.shed > 0
    assert loop.deadlines.changes["dropped"] == 1
    assert any(reduced for _, _, reduced in stages.steps)
    assert not stages.steps[-1][2]
    assert "every second sweep is left out" in caplog.text
    assert "nothing is given up" in caplog.text


def test_a_slow_loop_takes_the_newest_sweep_and_counts_what_it_misses():
    loop, sensor, _, _, _, seen = loop_of(20.0, lambda t: 0.15)
    loop.run()
    assert len(seen) + sensor.dropped + loop.deadlines.shed == 200
    assert loop.deadlines.timing.missed == len(seen) - 1  # all but the first one, which warms up


def test_after_a_long_first_frame_the_loop_begins_afresh():
    loop, sensor, stages, *_ = loop_of(3.0, lambda t: 0.25 if t < 0.2 else 0.02)
    loop.run()
    assert [index for index, *_ in stages.steps[:3]] == [1, 4, 5]
    assert sensor.dropped == loop.deadlines.shed == 1
    assert loop.deadlines.timing.report()["lateness_ms"]["max"] == 0.0


class Failing(Stages):
    """Fails at some frames."""

    fails = staticmethod(lambda index: index in (5, 6))

    def step(self, frame, budget, *, reduced):
        if self.fails(frame.index):
            raise IndexError(f"frame {frame.index}")
        return super().step(frame, budget, reduced=reduced)


def test_a_failure_costs_its_frame_and_is_said_once(caplog):
    loop, _, stages, _, _, seen = loop_of(2.0, stages=Failing)
    loop.run()
    assert sorted({*range(1, 21)} - {*seen}) == [5, 6]
    assert loop.failures.counts == {"frame: IndexError": 2}
    assert stages.recovered == [False, False]
    assert [r.exc_info is not None for r in caplog.records] == [True]


def test_failures_that_repeat_renew_the_stages_and_then_end_the_run():
    class Broken(Failing):
        fails = staticmethod(lambda index: index >= 5)

    loop, _, stages, _, _, seen = loop_of(10.0, stages=Broken)
    with pytest.raises(ModtError, match="10 failures in a row") as caught:
        loop.run()
    assert caught.value.exit_status == 1
    assert len(seen) == 4
    assert stages.recovered == [k == RENEW_AFTER for k in range(1, MAX_IN_A_ROW)]


def test_an_error_of_our_own_ends_the_run():
    class Told(Stages):
        def step(self, frame, budget, *, reduced):
            raise MisuseError("poses", "too few", "give more")

    loop, *_ = loop_of(1.0, stages=Told)
    with pytest.raises(MisuseError):
        loop.run()


def test_a_sink_that_fails_costs_neither_the_frame_nor_the_other_sinks():
    class Broken(Kept):
        def write(self, r):
            raise ConnectionError("gone")

    sinks = [Broken(), Kept()]
    loop, _, _, _, _, seen = loop_of(2.0, sinks=sinks)
    loop.run()
    assert sinks[1].indices == seen == list(range(1, 21))
    assert loop.failures.counts == {"sink 0: ConnectionError": 20}


@pytest.mark.parametrize(("broken", "kind"), [("_observe", "records"), ("_report", "status")])
def test_records_and_status_that_fail_cost_no_frame(broken, kind):
    def fail(*_):
        raise KeyError("wall_ns")

    sink = Kept()
    loop = loop_of(3.0, sinks=[sink])[0]
    setattr(loop, broken, fail)
    loop.run()
    assert len(sink.indices) == 30
    assert loop.failures.counts[f"{kind}: KeyError"] >= 3
    assert loop.failures.in_a_row == 0


def test_a_log_has_one_line_a_second_of_each_kind():
    now_s = [0.0]
    limit = OncePerSecond(lambda: now_s[0])
    lines = []
    for k in range(1000):
        now_s[0] = 0.01 * k
        for name, text in (("a", "%s: stepped"), ("a", "%s: silent"), ("b", "%s: stepped")):
            record = logging.LogRecord(name, logging.WARNING, "", 0, text, (k,), None)
            if limit.filter(record):
                lines.append(record.getMessage())
    assert len(lines) == 30
    assert lines[:4] == ["0: stepped", "0: silent", "0: stepped", "100: stepped (and 99 lines like it)"]


def test_a_reload_is_between_two_frames_and_an_invalid_one_is_refused(caplog):
    stop = Stop()
    loop, _, stages, told, _, seen = loop_of(2.0, stop=stop)
    stages.invalid = MisuseError("robot.yaml:3", "unknown key 'x'", "did you mean 'y'?")
    stop._on_reload(signal.SIGHUP, None)
    loop.run()
    assert (loop.reloads, loop.refused_reloads, stages.loads) == (0, 1, 0)
    assert "unknown key 'x'" in caplog.text
    assert len(seen) == 20
    assert told.said == ["ready", "reloading", "ready"]
    stages.invalid = None
    loop._reload(told)
    assert (loop.reloads, stages.loads) == (1, 1)


def test_a_source_that_fails_is_asked_again_and_after_ten_failures_ends_the_run():
    loop, sensor, *_ = loop_of(1.0)
    calls = []

    def gone(timeout_s):
        calls.append(timeout_s)
        raise RuntimeError("gone")

    sensor.take = gone
    with pytest.raises(ModtError, match="10 failures in a row, the last one RuntimeError: gone"):
        loop.run()
    assert len(calls) == 10


def test_a_signal_ends_the_loop_though_the_sensor_is_silent():
    stop = Stop()
    loop, sensor, *_ = loop_of(100.0, stop=stop)

    def silent(timeout_s):
        sensor.time.now += timeout_s
        if sensor.time.now > 103.0:
            stop.signal = "SIGTERM"

    sensor.take = silent
    loop.run()
    assert sensor.time.now < 103.0 + 0.5
