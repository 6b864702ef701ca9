"""The newest sweep is handed over; everything else is counted."""

import logging

import numpy as np
import pytest

from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import StreamEndedError, StreamInfo, Sweep
from tests.sources.live.readers import scripted

INFO = StreamInfo("sensor", "test")


def sweep(stamp_s, *, complete=True, x=5.0):
    return Sweep(stamp_s, np.full((10, 4), [x, 0, 0, 0.5], np.float32), complete=complete)


class Driven:
    """A stream without its thread. The test moves its clock and hands over the sweeps."""

    def __init__(self):
        self.now_s = 0.0
        self.stream = LiveStream(INFO, scripted(), clock=lambda: self.now_s)

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


@pytest.fixture
def driven():
    return Driven()


def test_the_newest_of_several_sweeps_is_taken_and_the_others_are_counted(driven):
    for waiting in (sweep(1.0), sweep(1.1, complete=False), sweep(1.2)):
        driven.stream._put(waiting)
    assert driven.stream.take(0.0).frame.stamp_s == 1.2
    assert driven.stream.take(0.0) is None
    health = driven.stream.health()
    assert (health["sweeps"], health["dropped_sweeps"], health["incomplete_sweeps"]) == (3, 2, 1)
    driven.stream._put(sweep(1.3))
    driven.stream.close()
    assert driven.stream.health()["dropped_sweeps"] == 3, "nobody takes the last one"


@pytest.mark.parametrize(
    ("stamp_s", "x", "cause"),
    [
        (1.0, 5.0, "0.000 s after the last sweep"),
        (0.5, 5.0, "0.500 s before the last sweep"),
        (60.0, 5.0, "59.000 s after the last sweep"),
        (1.1, 5000.0, "its columns are not"),
        *((stamp_s, 5.0, "is no time in seconds") for stamp_s in (np.nan, np.inf, 1.7e18, 1.7e12, -1e300)),
    ],
)
def test_unusable_sweeps_are_faults_and_the_next_good_one_is_taken(driven, caplog, stamp_s, x, cause):
    n = 20 if "no time" in cause else 1  # a clock that was set is followed
    driven.sweep(0.1, 1.0)
    for _ in range(n):
        assert driven.sweep(0.1, stamp_s, x) is None
    assert driven.sweep(0.1, 1.1 + 0.1 * n).stamp_s == 1.1 + 0.1 * n
    assert driven.stream.faults.skipped == n
    assert driven.stream.health()["time_steps"] == 0
    assert cause in caplog.text


def test_a_sweep_has_arrived_when_the_kernel_received_it(driven):
    driven.now_s = 7.0
    driven.stream._put(Sweep(1.0, sweep(1.0).points, waited_s=0.8))
    assert driven.stream.take(0.0).arrived_s == pytest.approx(6.2)


def test_a_failure_of_the_receiving_thread_costs_a_message_and_the_end_comes_after_the_last_sweep(caplog):
    failures = RuntimeError("broken"), [None], RuntimeError("broken"), OSError("down")
    stream = LiveStream(INFO, scripted(*failures, [sweep(1.0)], StreamEndedError()), clock=lambda: 0.0)
    stream.start()
    stream._thread.join(60.0)
    assert stream.take(60.0).frame.stamp_s == 1.0
    counted = {"RuntimeError": 2, "AttributeError": 1, "OSError": 1}
    assert stream.health()["refused_messages"] == {f"failed ({name})": n for name, n in counted.items()}
    assert caplog.text.count("a message is left out") == 3  # one line a reason
    with pytest.raises(StreamEndedError):
        stream.take(60.0)
    stream.close()


def test_a_silent_sensor_is_diagnosed_once_and_its_return_is_logged(driven, caplog):
    with caplog.at_level(logging.WARNING):
        driven.pass_time(1.8)
        assert driven.stream.silences == 0
        driven.pass_time(1.8)
        assert driven.stream.health()["silent"]
        assert driven.sweep(0.4, 1.0) is not None
    assert driven.stream.silences == 1
    lost, back = (record.message for record in caplog.records)
    assert "check its power, cable, address and port" in lost
    assert "sweeps again after 4.0 s" in back


@pytest.mark.parametrize("step_s", [-3600.0, -0.95, -0.5, 0.3, 0.7, 0.95, 3600.0])
def test_a_clock_that_is_set_is_followed_within_a_second_and_steady_time_goes_on(driven, step_s, caplog):
    taken = []
    times_s = []
    for k in range(1, 301):
        frame = driven.sweep(0.1, 500.0 + 0.1 * k + step_s * (k >= 50))
        if frame is not None:
            taken.append(k)
            times_s.append((driven.now_s, frame.time_s, frame.stamp_s))
    now_s, time_s, stamp_s = np.array(times_s).T
    assert np.abs(np.diff(time_s) - np.diff(now_s)).max() < 1e-6
    assert stamp_s[-1] == 500.0 + 0.1 * 300 + step_s
    assert np.diff(now_s).max() < 0.75  # less than tracks coast
    refused = sorted({*range(1, 301)} - {*taken})
    assert refused == list(range(50, 50 + len(refused)))
    assert frame.index == 299
    if abs(step_s) > 1:
        assert driven.stream.health()["time_steps"] == 1
        assert f"stamps have stepped by {step_s:+.3f} s against their arrival: a clock was set" in caplog.text


def test_steady_time_is_that_of_the_stamps_where_sweeps_arrive_late(driven):
    assert driven.sweep(0.0, 1.0).time_s == 1.0
    assert driven.sweep(0.1, 1.1).time_s == pytest.approx(1.1)
    assert driven.sweep(0.6, 1.2).time_s == pytest.approx(1.2)  # half a second late
    assert driven.sweep(0.0, 1.7).time_s == pytest.approx(1.7)
    assert driven.sweep(0.0, 1.7) is None  # twice at once


def test_a_sweep_from_before_the_process_was_stopped_is_discarded_and_no_sensor_blamed(driven, caplog):
    driven.sweep(0.1, 1.0)
    driven.stream._put(sweep(1.1))
    driven.now_s += 6.0  # SIGSTOP, and SIGCONT
    assert driven.stream.take(0.2) is None
    assert driven.stream.take(0.2) is None
    assert driven.stream.silences == 0
    assert driven.stream.faults.skipped == 1
    assert "this process was stopped" in caplog.text
    assert driven.sweep(0.0, 1.2) is None  # from the buffer of the system
    assert driven.sweep(0.1, 7.2).stamp_s == 7.2
    assert driven.stream.health()["time_steps"] == 0
    driven.pass_time(3.0)
    assert driven.stream.silences == 1  # now it is the sensor


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_the_unit_of_stamps_that_are_no_seconds_is_named(driven, factor, unit, caplog):
    for k in range(20):
        driven.sweep(0.1, factor * 0.1 * k)
    assert f"are they in {unit}? have its driver write s" in caplog.text
