"""The loop over a live source, on a clock that only working and waiting move."""

import logging
from unittest.mock import Mock, call

import numpy as np
import pytest

from modt.app.containment import MAX_IN_A_ROW, RENEW_AFTER, Containment, OncePerSecond
from modt.app.deadlines import Deadlines, Timing
from modt.app.ladder import Step
from modt.app.session import WAIT_S, Session
from modt.app.stop import Stop
from modt.errors import MisuseError, ModtError
from modt.sources.stream import Received, StreamEndedError
from modt.types import Budget, Frame
from tests.results import Kept, result

from .test_playback import Time

POINTS = np.zeros((1, 4), np.float32)


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
    """Stages that take some time, and fail at the frames in `fails`."""

    budget, chosen = Budget(16, None), None

    def __init__(self, time, work_s):
        self.time, self.work_s, self.fails, self.steps = time, work_s, {}, []
        self.recognise, self.watch, self.recover = Mock(), Mock(), Mock()
        stages = {"stages": {"segmentation": {"wall_ns": 20_000_000}}}
        self.ledger = Mock(run=lambda stage, write, r: write(r), close_frame=lambda index: {"frame": index, **stages})

    def step(self, frame, budget, *, reduced):
        if frame.index in self.fails:
            raise self.fails[frame.index]
        self.steps.append((frame.index, budget, reduced))
        self.time.now += self.work_s(self.time.now - 100.0)
        return result(frame.index, [3], {0: 1})


def loop_of(seconds, work=lambda t: 0.02, sinks=(), silent=(0.0, 0.0), stop=None, **calls):
    time = Time()
    sensor, stages = Sensor(time, seconds, silent), Stages(time, work)
    pings, reports, seen = [], [], []
    supervisor = Mock(pings=pings, alive=lambda: pings.append(time.now))
    named = {f"sink {k}": sink for k, sink in enumerate(sinks)}
    deadlines = Deadlines(0.1, time)
    loop = Session(sensor, stages, Mock(), named, deadlines, Containment(), stop or Stop(), (), None, clock=time)
    loop._observe = calls.get("observe", lambda r, line: seen.append(r.frame.index))
    loop._report = calls.get("report", lambda supervisor: reports.append(time.now))
    loop.run = lambda: loop.follow(supervisor)
    return loop, sensor, stages, supervisor, reports, seen


def test_every_sweep_in_time_goes_through():
    sink = Kept()
    loop, sensor, stages, supervisor, reports, seen = loop_of(10.0, sinks=[sink])
    loop.run()
    assert len(seen) == 100
    assert sink.indices == seen
    assert loop.deadlines.timing.missed == sensor.dropped == loop.deadlines.shed == 0
    assert loop.deadlines.report()["lateness_ms"]["max"] == 0.0
    ((first, named),) = (made.args for made in stages.recognise.call_args_list)
    assert (first.index, named) == (1, "vlp-16")
    assert [made.args[0].index for made in stages.watch.call_args_list] == seen
    assert loop.deadlines.timing.report()["latency_ms"]["max"] == pytest.approx(20.0)
    supervisor.ready.assert_called_once_with()
    assert len(reports) in (10, 11)
    assert stages.steps[-1][1] == Budget(16, pytest.approx(80.0)), "of the time that is left to the deadline"


def test_the_watchdog_is_served_while_the_sensor_is_silent():
    loop, _, _, supervisor, _, seen = loop_of(12.0, silent=(1.0, 11.0))
    loop.run()
    gaps = np.diff(supervisor.pings)
    assert max(gaps) <= WAIT_S + 0.11
    assert 15 < len(seen) < 25


def hog(begin, end, work_s):
    return lambda t: work_s if begin <= t < end else 0.02


def test_under_load_the_loop_sheds_and_is_back_within_a_second(caplog):
    loop, _, stages, *_ = loop_of(10.0, hog(2.0, 5.0, 0.15))
    with caplog.at_level(logging.WARNING):
        loop.run()
    reduced_s = [0.1 * index for index, _, reduced in stages.steps if reduced]
    assert 2.0 < min(reduced_s) < max(reduced_s) < 5.0 + 0.15 + 1.01
    assert loop.deadlines.ladder.step is Step.ALL
    assert loop.deadlines.shed > 0
    assert loop.deadlines.changes["dropped"] == 1
    assert len(caplog.records) >= 4, "each step is logged"


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


def test_a_failure_costs_its_frame_and_is_logged_once(caplog):
    loop, _, stages, _, _, seen = loop_of(2.0)
    stages.fails = dict.fromkeys((5, 6), IndexError("a bug"))
    loop.run()
    assert sorted({*range(1, 21)} - {*seen}) == [5, 6]
    assert loop.failures.counts == {"frame: IndexError": 2}
    assert stages.recover.call_args_list == [call(anew=False)] * 2
    assert [r.exc_info is not None for r in caplog.records] == [True]


def test_failures_that_repeat_renew_the_stages_and_then_end_the_run():
    loop, _, stages, _, _, seen = loop_of(10.0)
    stages.fails = dict.fromkeys(range(5, 100), IndexError("a bug"))
    with pytest.raises(ModtError, match="10 failures in a row") as caught:
        loop.run()
    assert caught.value.exit_status == 1
    assert len(seen) == 4
    assert stages.recover.call_args_list == [call(anew=k == RENEW_AFTER) for k in range(1, MAX_IN_A_ROW)]
    loop, _, stages, *_ = loop_of(1.0)
    stages.fails = {1: MisuseError("poses", "too few", "give more")}
    with pytest.raises(MisuseError):
        loop.run()


def test_a_replay_contains_no_failure():
    failures, gone = Containment(contains=False), ConnectionError("gone")
    for failing in (lambda: failures.spare("sink", Mock(side_effect=gone)), lambda: failures.fail(gone, "frame")):
        with pytest.raises(ConnectionError):
            failing()


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


def test_a_sink_that_fails_costs_neither_the_frame_nor_the_other_sinks():
    class Broken(Kept):
        def write(self, r):
            raise ConnectionError("gone")

    sinks = [Broken(), Kept()]
    loop, _, _, _, _, seen = loop_of(2.0, sinks=sinks)
    loop.run()
    assert sinks[1].indices == seen == list(range(1, 21))
    assert loop.failures.counts == {"sink 0: ConnectionError": 20}


@pytest.mark.parametrize(("broken", "kind"), [("observe", "records"), ("report", "status")])
def test_records_and_status_that_fail_cost_no_frame(broken, kind):
    def fail(*_):
        raise KeyError("wall_ns")

    sink = Kept()
    loop = loop_of(3.0, sinks=[sink], **{broken: fail})[0]
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


def test_a_frame_is_missed_when_its_result_comes_after_the_next_sweep():
    timing = Timing()
    assert timing.add(10.0, 10.001, 10.05, 0.1) == pytest.approx(0.5)
    assert timing.add(10.1, 10.15, 10.21, 0.1) == pytest.approx(1.1)
    report = timing.report()
    assert (report["frames"], report["missed_deadlines"]) == (2, 1)
    assert report["lateness_ms"]["max"] == pytest.approx(50.0)
    assert report["execution_ms"]["max"] == pytest.approx(60.0)
    assert report["latency_ms"]["max"] == pytest.approx(110.0)


def line(**ms):
    return {"stages": {stage: {"wall_ns": int(1e6 * value)} for stage, value in ms.items()}}


def test_the_cost_of_the_rest_rises_at_once_and_falls_slowly():
    deadlines = Deadlines(0.1, lambda: 0.0)

    def rest_ms(**ms):
        deadlines.finish(0.0, line(**ms))
        return deadlines.report()["other_stages_ms"]

    assert rest_ms(segmentation=10, tracking=5, classification=50) == pytest.approx(15)
    assert rest_ms(segmentation=30) == pytest.approx(30)
    assert 28 < rest_ms(segmentation=10) < 30
    for _ in range(200):
        last_ms = rest_ms(segmentation=10)
    assert last_ms == pytest.approx(10, rel=0.01)
