"""The newest sweep is handed over; everything else is counted."""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence

import numpy as np
import pytest

from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import Received, Reception, StreamEndedError, StreamInfo, Sweep

INFO = StreamInfo("sensor", "test", 0, None, 0.1, None, False)


class ScriptedReader:
    """Hands over batches of sweeps, one a call, when the test says so."""

    profile = None

    def __init__(self) -> None:
        self.reception = Reception()
        self._batches: list[Sequence[Sweep] | Exception] = []
        self._ready = threading.Semaphore(0)

    def give(self, batch: Sequence[Sweep] | Exception) -> None:
        self._batches.append(batch)
        self._ready.release()

    def read(self, timeout_s: float) -> Sequence[Sweep]:
        if not self._ready.acquire(timeout=timeout_s):
            return []
        batch = self._batches.pop(0)
        if isinstance(batch, Exception):
            raise batch
        return batch

    def close(self) -> None:
        pass


def sweep(stamp_s: float, *, complete: bool = True, x: float = 5.0) -> Sweep:
    return Sweep(stamp_s, np.full((10, 4), [x, 0, 0, 0.5], np.float32), complete=complete)


@pytest.fixture
def live():
    reader = ScriptedReader()
    stream = LiveStream(INFO, reader, clock=lambda: 0.0)  # no sweep is late, however busy the machine
    stream.start()
    yield reader, stream
    stream.close()


def taken(stream: LiveStream) -> Received:
    received = stream.take(60.0)
    assert received is not None
    return received


def test_the_newest_of_several_sweeps_is_taken_and_the_others_are_counted(live):
    reader, stream = live
    reader.give([sweep(1.0), sweep(1.1, complete=False), sweep(1.2)])
    deadline = threading.Event()
    while stream.sweeps < 3:
        deadline.wait(0.01)
    assert taken(stream).frame.stamp_s == 1.2
    assert stream.take(0.0) is None
    health = stream.health()
    assert (health["sweeps"], health["dropped_sweeps"], health["incomplete_sweeps"]) == (3, 2, 1)


@pytest.mark.parametrize(
    ("unusable", "cause"),
    [
        (sweep(1.0), "0.000 s after the last sweep"),
        (sweep(0.5), "0.500 s before the last sweep"),
        (sweep(60.0), "59.000 s after the last sweep"),
        (sweep(1.1, x=5000.0), "its columns are not"),
    ],
)
def test_an_unusable_sweep_is_a_fault_and_the_next_one_is_taken(live, caplog, unusable, cause):
    reader, stream = live
    reader.give([sweep(1.0)])
    taken(stream)
    reader.give([unusable])
    assert stream.take(60.0) is None
    reader.give([sweep(1.2)])
    assert taken(stream).frame.stamp_s == 1.2
    assert stream.faults.skipped == 1
    assert cause in caplog.text


def test_a_failure_of_the_receiving_thread_costs_a_message(live, caplog):
    reader, stream = live
    for batch in (RuntimeError("broken"), [None], RuntimeError("broken"), OSError("down"), [sweep(1.0)]):
        reader.give(batch)
    assert taken(stream).frame.stamp_s == 1.0
    failures = {"RuntimeError": 2, "AttributeError": 1, "OSError": 1}
    assert stream.health()["refused_messages"] == {f"failed ({name})": n for name, n in failures.items()}
    assert caplog.text.count("a message is left out") == 3  # one line a reason


def test_a_silent_sensor_is_diagnosed_once_and_its_return_is_logged(caplog):
    reader, now_s = ScriptedReader(), [0.0]
    stream = LiveStream(INFO, reader, clock=lambda: now_s[0])
    stream.start()
    with caplog.at_level(logging.WARNING):
        for now_s[0] in (0.9, 1.9):
            assert stream.take(0.0) is None
        assert stream.silences == 0
        for now_s[0] in (2.1, 3.0):
            assert stream.take(0.0) is None
        assert stream.health()["silent"]
        now_s[0] = 4.0
        reader.give([sweep(1.0)])
        taken(stream)
    stream.close()
    assert stream.silences == 1
    assert [record.message for record in caplog.records] == [
        "sensor: no sweep for 2 s; check its power, cable, address and port; tracks are kept until it returns",
        "sensor: sweeps again after 4.0 s",
    ]


def test_the_end_of_a_recording_comes_after_its_last_sweep(live):
    reader, stream = live
    reader.give([sweep(1.0)])
    reader.give(StreamEndedError())
    waiting = threading.Event()
    while stream._thread.is_alive():
        waiting.wait(0.01)
    assert taken(stream).frame.stamp_s == 1.0
    with pytest.raises(StreamEndedError):
        stream.take(60.0)


class Driven:
    """A stream without its thread, on a clock of the test's; sweeps arrive when it says so."""

    def __init__(self):
        self.now_s = 0.0
        self.stream = LiveStream(INFO, ScriptedReader(), clock=lambda: self.now_s)

    def sweep(self, after_s, stamp_s, x=5.0):
        """The frame of a sweep that arrives after some time; None where it is refused."""
        self.now_s += after_s
        self.stream._put(sweep(stamp_s, x=x))
        received = self.stream.take(0.0)
        return None if received is None else received.frame

    def pass_time(self, seconds):
        for _ in range(round(seconds / 0.2)):
            self.now_s += 0.2
            assert self.stream.take(0.0) is None


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_clock_that_was_set_is_followed_within_a_second(step_s, caplog):
    driven = Driven()
    refused = [k for k in range(1, 31) if driven.sweep(0.1, 0.1 * k + step_s * (k > 10)) is None]
    assert refused == list(range(11, 11 + len(refused)))
    assert 1 <= len(refused) <= 9
    assert driven.stream.health()["time_steps"] == 1
    assert f"stamps have stepped by {step_s:+.3f} s against their arrival: a clock was set" in caplog.text
    assert driven.sweep(0.1, 3.1 + step_s).index == 30


@pytest.mark.parametrize("step_s", [-3600.0, -0.95, -0.5, 0.3, 0.7, 0.95, 3600.0])
def test_steady_time_passes_as_arrivals_do_whatever_the_clock_does(step_s):
    driven, times_s = Driven(), []
    for k in range(1, 301):
        frame = driven.sweep(0.1, 500.0 + 0.1 * k + step_s * (k >= 50))
        if frame is not None:
            times_s.append((driven.now_s, frame.time_s, frame.stamp_s))
    now_s, time_s, stamp_s = np.array(times_s).T
    assert np.abs(np.diff(time_s) - np.diff(now_s)).max() < 1e-6
    assert stamp_s[-1] == 500.0 + 0.1 * 300 + step_s
    assert np.diff(now_s).max() < 0.75  # less than tracks coast


def test_steady_time_is_that_of_the_stamps_where_sweeps_arrive_late():
    driven = Driven()
    assert driven.sweep(0.0, 1.0).time_s == 1.0
    assert driven.sweep(0.1, 1.1).time_s == pytest.approx(1.1)
    assert driven.sweep(0.6, 1.2).time_s == pytest.approx(1.2)  # half a second late
    assert driven.sweep(0.0, 1.7).time_s == pytest.approx(1.7)


def test_a_set_clock_is_followed_once_though_no_sweep_can_be_used(caplog):
    driven = Driven()
    driven.sweep(0.1, 1000.0)
    for k in range(100):
        assert driven.sweep(0.1, 500.0 + 0.1 * k, x=5000.0) is None
    assert driven.stream.health()["time_steps"] == 1
    assert caplog.text.count("have stepped by") == 1
    assert driven.sweep(0.1, 510.0).stamp_s == 510.0


def test_a_sweep_from_before_the_process_was_stopped_is_discarded_and_no_sensor_blamed(caplog):
    driven = Driven()
    driven.sweep(0.1, 1.0)
    driven.stream._put(sweep(1.1))
    driven.now_s += 6.0  # SIGSTOP, and SIGCONT
    assert driven.stream.take(0.2) is None
    assert driven.stream.take(0.2) is None
    assert driven.stream.silences == 0
    assert driven.stream.faults.skipped == 1
    assert "taken 6.0 s after it came: this process was stopped" in caplog.text
    assert driven.sweep(0.0, 1.2) is None  # from the buffer of the system
    assert "this process, the sender or the network was stopped" in caplog.text
    assert driven.sweep(0.1, 7.2).stamp_s == 7.2
    assert driven.stream.health()["time_steps"] == 0
    driven.pass_time(3.0)
    assert driven.stream.silences == 1  # now it is the sensor


@pytest.mark.parametrize("stamp_s", [np.nan, np.inf, 1.7e18, 1.7e12, -1e300])
def test_a_stamp_that_is_no_time_in_seconds_is_refused_and_forgotten(stamp_s, caplog):
    driven = Driven()
    driven.sweep(0.1, 1.7e9)
    for _ in range(20):
        assert driven.sweep(0.1, stamp_s) is None
    assert "is no time in seconds" in caplog.text
    assert driven.sweep(0.1, 1.7e9 + 2.1).stamp_s == 1.7e9 + 2.1
    assert driven.stream.health()["time_steps"] == 0


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_stamps_in_another_unit_are_said_to_be(factor, unit, caplog):
    driven = Driven()
    for k in range(20):
        driven.sweep(0.1, factor * 0.1 * k)
    assert f"are they in {unit}? have its driver write s" in caplog.text
