"""Two live sensors as one source: neither waits long for the other."""

import socket
import time
from itertools import islice

import numpy as np
import pytest

from modt.schemes import open_sensor
from modt.sources.live.joint_live import WAITED_PERIODS, JointLive
from modt.sources.live.live_stream import LiveStream
from modt.sources.stream import StreamEndedError, StreamInfo, Sweep
from tests.robots import CORNERS, mounted
from tests.sources.live.readers import scripted
from tests.sources.packets.simulated import packets
from tools.send.loops import endless

PERIOD_S = 0.1
MOST_PACKETS = 20_000


class Robot:
    """Two streams without their threads, on a clock that the test moves; waiting moves it too."""

    def __init__(self):
        self.now_s = 0.0
        self.waits = []
        self.streams = [self._stream() for _ in CORNERS]
        self.source = JointLive(CORNERS, self.streams, clock=self.clock, wait=self.wait)

    def _stream(self):
        return LiveStream(StreamInfo("sensor", "test", period_s=PERIOD_S), scripted(), clock=self.clock)

    def clock(self):
        return self.now_s

    def wait(self, seconds):
        self.waits.append(seconds)
        self.now_s += seconds

    def send(self, sensor, stamp_s, at_s):
        """A sweep that arrives at a time."""
        self.now_s = max(self.now_s, at_s)
        points = np.full((5, 4), [3.0, 0, 0, 0.5], np.float32)
        self.streams[sensor]._put(Sweep(stamp_s, points))

    def present(self, timeout_s=0.0):
        """Sensors that have a sweep in the next frame; None without a frame."""
        received = self.source.take(timeout_s)
        return None if received is None else tuple(each is not None for each in received.frame.sweeps)


@pytest.fixture
def pair():
    return Robot()


def test_sweeps_near_one_another_are_one_frame_when_the_second_has_come(pair):
    pair.send(0, 1.0, 0.0)
    assert pair.present() is None
    pair.send(1, 1.03, 0.03)
    received = pair.source.take(0.0)
    assert received.frame.stamp_s == 1.0
    assert received.frame.sweeps[1].stamp_s == 1.03
    assert received.arrived_s == 0.03


def test_a_silent_sensor_is_waited_for_once_and_joined_when_it_is_back(pair):
    for k in range(3):
        pair.send(0, 1 + k * PERIOD_S, k * PERIOD_S)
        pair.send(1, 1 + k * PERIOD_S, k * PERIOD_S)
        assert pair.present() == (True, True)
    for k in range(3, 8):
        pair.send(0, 1 + k * PERIOD_S, k * PERIOD_S)
        assert pair.present(PERIOD_S) == (True, False)
    assert pair.waits == pytest.approx([WAITED_PERIODS * PERIOD_S])
    assert pair.source.health()["alone"] == {"front": 5}
    pair.send(1, 1.8, 0.8)
    assert pair.present() is None
    pair.send(0, 1.8, 0.8)
    assert pair.present() == (True, True)


def test_a_sensor_that_never_sends_keeps_the_other_no_longer_than_once(pair):
    for k in range(4):
        pair.send(1, k * PERIOD_S, k * PERIOD_S)
        assert pair.present(PERIOD_S) == (False, True)
    assert len(pair.waits) == 1


def test_waiting_ends_at_the_timeout_without_a_frame(pair):
    assert pair.source.take(0.2) is None
    assert pair.now_s == pytest.approx(0.2)


def test_each_silent_sensor_is_logged_by_its_name(pair, caplog):
    for _ in range(25):
        assert pair.source.take(0.1) is None
    named = [record.getMessage().partition(" of ")[0] for record in caplog.records if "no sweep" in record.msg]
    assert named == [stream.info.name.partition(" of ")[0] for stream in pair.streams]
    assert len(set(named)) == 2


def test_clocks_that_differ_are_named_and_sweeps_joined_by_their_arrival(pair, caplog):
    for k in range(5):
        pair.send(0, 100 + k * PERIOD_S, k * PERIOD_S)
        pair.send(1, 7 + k * PERIOD_S, k * PERIOD_S + 0.01)
        received = pair.source.take(0.0)
        assert all(received.frame.sweeps)
        assert received.frame.sweeps[1].stamp_s - received.frame.stamp_s == pytest.approx(0.01, abs=1e-3)
    assert caplog.text.count("the clocks of the sensors rear and front differ by 93.010 s") == 1


def test_steady_time_goes_on_when_another_sensor_leads(pair):
    times = []
    for k in range(6):
        for sensor in (0, 1) if k < 3 else (1,):
            pair.send(sensor, 1 + k * PERIOD_S, k * PERIOD_S)
        times.append(pair.source.take(PERIOD_S).frame.time_s)
    assert np.diff(times) == pytest.approx([PERIOD_S] * 5)


def test_a_sensor_that_ends_leaves_the_other_and_the_last_one_ends_the_source(pair, caplog):
    pair.streams[0]._error = OSError("gone")
    pair.send(1, 1.0, 0.0)
    assert pair.present(PERIOD_S) == (False, True)
    assert "sensor front has ended: gone" in caplog.text
    pair.streams[1]._error = StreamEndedError()
    with pytest.raises((OSError, StreamEndedError)):
        pair.present()


def test_counts_of_both_are_added_and_kept_apart(pair):
    pair.send(0, 1.0, 0.0)
    pair.send(1, 1.0, 0.0)
    pair.send(1, 1.1, 0.1)
    health = pair.source.health()
    assert (health["sweeps"], health["dropped_sweeps"], health["silent"]) == (3, 1, False)
    assert [health["sensors"][name]["sweeps"] for name in ("front", "rear")] == [1, 2]
    assert pair.source.reading.sweeps == 3


def test_packets_to_two_ports_are_frames_of_one_robot(ports):
    """Over loopback. Packets are sent until a frame has both sensors; no wait of the source ends before."""
    sensors = [mounted(f"sensor-{port}", 0.0, 0.0, 0.0, f"velodyne://127.0.0.1:{port}") for port in ports]
    source = JointLive(sensors, [open_sensor(sensor.source) for sensor in sensors], clock=lambda: 0.0)
    source.start()
    both = None
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for _, payload in islice(endless([payload for _, payload in packets("vlp-16")]), MOST_PACKETS):
                for port in ports:
                    sender.sendto(payload, ("127.0.0.1", port))
                time.sleep(1e-3)  # a busy machine loses packets that come all at once
                received = source.take(0.0)
                if received is not None and all(received.frame.sweeps):
                    both = received.frame
                    break
    finally:
        source.close()
    assert both is not None
    assert len(both.points) == sum(len(sweep.points) for sweep in both.sweeps)
