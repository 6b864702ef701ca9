"""The frames of a live source or a recording, on a clock that only working and waiting move."""

import dataclasses
import itertools
import logging
import os
import signal
import threading
from types import SimpleNamespace
from unittest.mock import Mock, call

import numpy as np
import pytest

from modt.app.deadlines import Deadlines
from modt.app.failures import MAX_IN_A_ROW, MAX_KINDS, RENEW_AFTER, Failures, OncePerSecond
from modt.app.load_shedding import Step
from modt.app.loop import WAIT_S, Service
from modt.app.playback import Playback
from modt.app.stop import NAP_S, Stop
from modt.energy.ledger import Ledger, StageWork
from modt.errors import MisuseError, ModtError
from modt.sinks.background import Background
from modt.sinks.recording import AtOnce
from modt.sources.stream import Received, StreamEndedError
from modt.types import Budget, Frame, Trust, TrustLevel
from tests.results import Kept, ledger_line, result, status

POINTS = np.zeros((1, 4), np.float32)


def line_of(**ms):
    """A ledger line of stages that take so long."""
    return ledger_line(0, **{stage: StageWork(wall_ns=int(1e6 * value)) for stage, value in ms.items()})


class Time:
    """A clock that only sleeping and working move."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        assert seconds > 0
        self.now += seconds


class Sensor:
    """A sweep every 0.1 s until an end; the newest one is taken, as from a LiveStream."""

    def __init__(self, time, seconds, silent=(0.0, 0.0)):
        self.time = time
        self.end = 100.0 + seconds
        self.profile = "vlp-16"
        self.silent = silent
        self.taken = 0
        self.dropped = 0

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
            self.taken = self.taken + 1
            self.dropped = self.dropped + 1
            due = 100.0 + 0.1 * (self.taken + 1)
        self.taken += 1
        self.time.now = max(self.time.now, due)
        return Received(Frame(self.taken, due, POINTS), due)


class Stages:
    """Stages that take some time, and fail at the frames in `fails`."""

    budget = Budget(16, None)
    chosen = None

    def __init__(self, time, work_s, fails):
        self.time = time
        self.work_s = work_s
        self.fails = fails
        self.steps = []
        self.choose_profile = Mock()
        self.adapt = Mock()
        self.recover = Mock()
        line = line_of(segmentation=20)
        self.ledger = Mock(run=lambda stage, write, r: write(r), close_frame=lambda index: line)

    def step(self, frame, budget, *, reduced):
        if frame.index in self.fails:
            raise self.fails[frame.index]
        self.steps.append((frame.index, budget, reduced))
        self.time.now += self.work_s(self.time.now - 100.0)
        return result(frame.index, [3], {0: 1})


class Live:
    """A service over the sensor, and the frames, reports and pings of the watchdog that it makes."""

    def __init__(self, seconds, work=lambda t: 0.02, sinks=(), silent=(0.0, 0.0), fails=(), **calls):
        self.time = time = Time()
        self.sensor = Sensor(time, seconds, silent)
        self.stages = Stages(time, work, dict(fails))
        self.seen = []
        self.reports = []
        self.pings = []
        self.notifier = Mock(alive=lambda: self.pings.append(time.now))
        self.deadlines = Deadlines(0.1, time)
        self.failures = Failures()
        self.stop = Stop()
        self.service = Service(
            source=self.sensor,
            stages=self.stages,
            recording=Mock(),
            sinks={f"sink {k}": sink for k, sink in enumerate(sinks)},
            deadlines=self.deadlines,
            failures=self.failures,
            stop=self.stop,
            meters=(),
            core=None,
            clock=time,
        )
        self.service._account = calls.get("account", lambda r, line: self.seen.append(r.frame.index))
        self.service._report = calls.get("report", lambda notifier: self.reports.append(time.now))

    def run(self):
        self.service.process_frames(self.notifier)
        return self


@pytest.mark.parametrize(("results", "shown"), [("always", 20), ("unless_blind", 10)])
def test_sinks_get_no_result_of_a_blind_sensor_where_the_profile_says_so(results, shown):
    sink = Kept()
    live = Live(2.0, sinks=[sink])
    live.stages.config = SimpleNamespace(trust=SimpleNamespace(results=results))
    step = live.stages.step

    def half_blind(frame, budget, *, reduced):
        level = TrustLevel.BLIND if frame.index > 10 else TrustLevel.GOOD
        return dataclasses.replace(step(frame, budget, reduced=reduced), trust=Trust(level))

    live.stages.step = half_blind
    live.run()
    assert len(sink.indices) == shown
    assert live.service.recording.write.call_count == len(live.seen) == 20, "the records go on"


def test_the_sensor_is_told_again_by_the_first_sweep_with_enough_points():
    live = Live(2.0)
    take = live.sensor.take

    def uncovered_at_the_fifth(timeout_s):
        received = take(timeout_s)
        if received is None or received.frame.index < 5:
            return received
        points = np.full((2000, 4), 5.0, np.float32)
        return dataclasses.replace(received, frame=dataclasses.replace(received.frame, points=points))

    live.sensor.take = uncovered_at_the_fifth
    live.run()
    assert [made.args[0].index for made in live.stages.choose_profile.call_args_list] == [1, 5]


def test_every_sweep_in_time_goes_through():
    sink = Kept()
    live = Live(10.0, sinks=[sink]).run()
    assert len(live.seen) == 100
    assert sink.indices == live.seen
    assert live.deadlines.missed == live.sensor.dropped == live.deadlines.shed == 0
    assert live.deadlines.figures().lateness_ms["max"] == 0.0
    ((first, named),) = (made.args for made in live.stages.choose_profile.call_args_list)
    assert (first.index, named) == (1, "vlp-16")
    assert [made.args[0].index for made in live.stages.adapt.call_args_list] == live.seen
    figures = live.deadlines.figures()
    assert (figures.execution_ms["max"], figures.latency_ms["max"]) == pytest.approx((20.0, 20.0))
    live.notifier.ready.assert_called_once_with()
    assert len(live.reports) in (10, 11)
    assert live.stages.steps[-1][1] == Budget(16, pytest.approx(80.0)), "of the time that is left to the deadline"


def test_the_watchdog_is_served_while_the_sensor_is_silent():
    live = Live(12.0, silent=(1.0, 11.0)).run()
    assert max(np.diff(live.pings)) <= WAIT_S + 0.11
    assert 15 < len(live.seen) < 25


def test_under_load_the_loop_sheds_and_is_back_within_a_second(caplog):
    with caplog.at_level(logging.WARNING):
        live = Live(10.0, lambda t: 0.15 if 2.0 <= t < 5.0 else 0.02).run()
    reduced_s = [0.1 * index for index, _, reduced in live.stages.steps if reduced]
    assert 2.0 < min(reduced_s) < max(reduced_s) < 5.0 + 0.15 + 1.01
    assert live.deadlines.shedding.step is Step.ALL
    assert live.deadlines.shed > 0
    assert live.deadlines.changes["dropped"] == 1
    assert len(caplog.records) >= 4, "each step is logged"


def test_a_slow_loop_takes_the_newest_sweep_and_counts_what_it_misses():
    live = Live(20.0, lambda t: 0.15).run()
    assert len(live.seen) + live.sensor.dropped + live.deadlines.shed == 200
    assert live.deadlines.missed == len(live.seen) - 1  # all but the first one, which warms up
    figures = live.deadlines.figures()
    assert 0.0 < figures.lateness_ms["max"] < 100.0
    assert figures.latency_ms["max"] == pytest.approx(figures.lateness_ms["max"] + 150.0, abs=5.0)


def test_after_a_long_first_frame_the_loop_begins_afresh():
    live = Live(3.0, lambda t: 0.25 if t < 0.2 else 0.02).run()
    assert live.seen[:3] == [1, 4, 5]
    assert live.sensor.dropped == live.deadlines.shed == 1
    assert live.deadlines.figures().lateness_ms["max"] == 0.0


def test_a_failure_costs_its_frame_and_is_logged_once(caplog):
    live = Live(2.0, fails=dict.fromkeys((5, 6), IndexError("a bug"))).run()
    assert sorted({*range(1, 21)} - {*live.seen}) == [5, 6]
    assert live.failures.counts == {"frame: IndexError": 2}
    assert live.stages.recover.call_args_list == [call(anew=False)] * 2
    assert [r.exc_info is not None for r in caplog.records] == [True]


def test_failures_that_repeat_renew_the_stages_and_then_end_the_run():
    live = Live(10.0, fails=dict.fromkeys(range(5, 100), IndexError("a bug")))
    with pytest.raises(ModtError, match="10 failures in a row") as caught:
        live.run()
    assert caught.value.exit_status == 1
    assert live.seen == [1, 2, 3, 4]
    assert live.stages.recover.call_args_list == [call(anew=k == RENEW_AFTER) for k in range(1, MAX_IN_A_ROW)]
    with pytest.raises(MisuseError):
        Live(1.0, fails={1: MisuseError("poses", "too few", "give more")}).run()


def test_a_replay_contains_no_failure():
    failures = Failures(contained=False)
    gone = ConnectionError("gone")
    for failing in (lambda: failures.contain("sink", Mock(side_effect=gone)), lambda: failures.fail(gone, "frame")):
        with pytest.raises(ConnectionError):
            failing()


def test_a_source_that_fails_is_asked_again_and_after_ten_failures_ends_the_run():
    live = Live(1.0)
    live.sensor.take = Mock(side_effect=RuntimeError("gone"))
    with pytest.raises(ModtError, match="10 failures in a row, the last one RuntimeError: gone"):
        live.run()
    assert live.sensor.take.call_count == 10


@pytest.mark.parametrize(("broken", "kind"), [("sink", "sink 0"), ("account", "records"), ("report", "status")])
def test_a_sink_records_and_status_that_fail_cost_no_frame(broken, kind):
    failing = Mock(side_effect=KeyError("wall_ns"))
    sink = Kept()
    sinks, calls = ([Mock(write=failing), sink], {}) if broken == "sink" else ([sink], {broken: failing})
    live = Live(3.0, sinks=sinks, **calls).run()
    assert sink.indices == [index for index, *_ in live.stages.steps] == list(range(1, 31))
    assert live.failures.counts.keys() == {f"{kind}: KeyError"}
    assert live.failures.counts.total() >= 3
    assert live.failures.in_a_row == 0


@pytest.mark.parametrize("error", [MisuseError("model", "gone", "restore it"), OSError("disk")])
@pytest.mark.parametrize("broken", ["choose_profile", "adapt", "recover"])
def test_files_that_are_gone_while_the_service_runs_cost_no_frame_and_are_said(broken, error, caplog):
    live = Live(2.0, fails={3: RuntimeError("its frame")} if broken == "recover" else {})
    getattr(live.stages, broken).side_effect = error
    live.run()
    assert len(live.seen) == 20 - (broken == "recover")
    kind = f"{'recovery' if broken == 'recover' else 'profile'}: {type(error).__name__}"
    assert live.failures.counts[kind] == (20 if broken == "adapt" else 1)
    assert caplog.text.count(f"{kind}; later ones are only counted") == 1


def test_a_reload_that_fails_in_any_way_is_refused_and_said(caplog):
    live = Live(2.0)
    live.stages.reload = Mock(side_effect=OSError("disk"))
    live.stop.take_reload = Mock(side_effect=[True, *[False] * 99])
    live.run()
    assert len(live.seen) == 20
    assert (live.service.reloads, live.service.refused_reloads) == (0, 1)
    assert "disk; the profile before stays in use" in caplog.text


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


def test_lines_that_differ_by_numbers_are_of_one_kind_and_kinds_are_bounded():
    limit = OncePerSecond(lambda: 0.0)

    def passes(text):
        return limit.filter(logging.LogRecord("a", logging.WARNING, "", 0, text, (), None))

    clients = [f"client 127.0.0.1:{port} left after {port / 7:.2f} s" for port in range(30000, 31000)]
    assert sum(passes(text) for text in clients) == 1
    for sensor in ("lidar1", "lidar2"):
        assert passes(f"{sensor}: no sweep for %.0f s")
    words = ["".join(letters) for letters in itertools.product("uvwxyz", repeat=5)]
    assert all(passes(f"kind {word}") for word in words)
    assert len(limit._passed) == MAX_KINDS


def test_a_place_of_the_status_that_hangs_keeps_it_from_no_other(tmp_path, monkeypatch):
    may_end = threading.Event()
    monkeypatch.setattr("modt.app.prometheus.write_metrics", lambda path, text: may_end.wait(60))
    monkeypatch.setattr("modt.app.loop.asdict", dict)  # a status that is a table already
    service = Live(1.0).service
    service.recording.writer = AtOnce()
    service.metrics = tmp_path / "modt.prom"
    service.writers["metrics"] = Background("metrics", AtOnce(), 1)
    try:
        for _ in range(5):
            service._write_status(status())
        assert service.recording.write_status.call_count == service.recording.keep_status.call_count == 5
        assert service.writers["metrics"].health()["dropped"] >= 3
    finally:
        may_end.set()
        service.writers["metrics"].close()


def test_deadlines_follow_a_sensor_at_another_rate_and_come_back():
    live = Live(1.0)
    live.stages.trust = Mock(record=lambda **silent: {})
    live.sensor.info = SimpleNamespace(period_s=0.1)
    live.sensor.health = lambda: {"period_s": live.sensor.period_s, "refused_messages": {}}
    live.service.status = Mock()
    live.service._write_status = Mock()
    for period_s, reasons in ((0.05, ["period"]), (0.1, [])):
        live.sensor.period_s = period_s
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("modt.app.loop.one_line", lambda status: "")
            Service._report(live.service, live.notifier)
        assert list(live.stages.source_findings) == reasons
        live.deadlines.budget(Budget(16, None), 100.0, 0)
        assert live.deadlines.figures().budget_ms == pytest.approx(1e3 * period_s)


def test_a_signal_ends_the_loop_though_the_sensor_is_silent():
    live = Live(100.0)

    def silent(timeout_s):
        live.time.now += timeout_s
        if live.time.now > 103.0:
            live.stop.signal = "SIGTERM"

    live.sensor.take = silent
    assert live.run().time.now < 103.0 + 0.5


def test_the_cost_of_the_rest_rises_at_once_and_falls_slowly():
    deadlines = Deadlines(0.1, lambda: 0.0)

    def rest_ms(**ms):
        deadlines.finish(0.0, line_of(**ms))
        return deadlines.figures().other_stages_ms

    assert rest_ms(segmentation=10, tracking=5, classification=50) == pytest.approx(15)
    assert rest_ms(segmentation=30) == pytest.approx(30)
    assert 28 < rest_ms(segmentation=10) < 30
    for _ in range(200):
        last_ms = rest_ms(segmentation=10)
    assert last_ms == pytest.approx(10, rel=0.01)


class Frames(list):
    info = SimpleNamespace(profile=None)
    faults = None


def starts(work):
    """Times at which frames of a replay at 10 Hz begin that take so long."""
    time = Time()
    out = list[float]()
    playback = Playback(Frames(work), Ledger(), 10.0, time.sleep, time)
    for _ in work:
        seconds = playback.take(0.0).frame
        out.append(time.now - 100.0)
        time.now += seconds
    with pytest.raises(StreamEndedError):
        playback.take(0.0)
    return out


def test_frames_start_at_absolute_times_and_a_stall_is_followed_by_no_burst():
    assert starts([0.03, 0.09, 0.0, 0.05]) == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert starts([0.35, 0.01, 0.01, 0.01]) == pytest.approx([0.0, 0.35, 0.45, 0.55])


def test_a_signal_ends_a_long_sleep_of_naps_that_add_up_to_it():
    time = Time()
    naps = []

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


@pytest.mark.parametrize("apart_s", [0.001, 0.9])
def test_two_signals_within_a_second_are_one_request(apart_s):
    time = Time()
    with Stop(time.sleep, time).on_signals() as stop:
        signal.raise_signal(signal.SIGTERM)
        time.sleep(apart_s)
        signal.raise_signal(signal.SIGINT)  # another one, as a launcher passes on a Ctrl-C as SIGTERM
        assert stop.signal == "SIGTERM"


def test_a_later_signal_ends_the_process_at_once():
    time = Time()
    with Stop(time.sleep, time).on_signals():
        signal.raise_signal(signal.SIGINT)
        time.sleep(1.1)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
