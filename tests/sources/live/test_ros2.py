"""PointCloud2 topics as a live source."""

import dataclasses

import numpy as np
import pytest

from modt.schemes import open_sensor
from modt.types import Frame
from tests.ros2 import messages
from tests.ros2.network import FAR, NEAR, Scripted, has_sender, until

pytest.importorskip("cyclonedds")
from modt.ros2 import dds
from modt.ros2.point_cloud2 import write_cloud
from modt.sources.live.ros2 import MissingSweeps, PointCloudReader
from tools.send.ros2 import Sender, looped, pace


def cloud(stamp_s=5.0, frame_id="lidar", n=10):
    return write_cloud(stamp_s, frame_id, np.full((n, 4), 0.5, np.float32))


def read(*batches):
    """Sweeps of batches of messages, and their reader."""
    reader = PointCloudReader(Scripted(*batches), "/points")
    return [sweep for _ in batches for sweep in reader.read(0.0)], reader


def test_messages_become_sweeps_and_the_frame_is_reported(caplog):
    caplog.set_level("INFO")
    sweeps, reader = read([cloud(5.0), cloud(5.1)], [cloud(5.2), cloud(0.0)])
    assert [(sweep.frame_id, len(sweep.points)) for sweep in sweeps] == [("lidar", 10)] * 4
    assert [sweep.stamp_s for sweep in sweeps] == [5.0, 5.1, 5.2, 77.0]  # without a stamp: when it was sent
    assert reader.reception.frame_id == "lidar"
    assert caplog.text.count("points are in the frame 'lidar'") == 1
    reader.close()
    assert reader.read(0.0) == []


@pytest.mark.parametrize(("frame_id", "warned"), [("velodyne", False), ("base_link", True), ("/map", True)])
def test_points_in_the_frame_of_a_robot_or_map_are_warned_of(caplog, frame_id, warned):
    read([cloud(frame_id=frame_id)])
    assert ("not in the sensor's: subscribe to what its driver publishes" in caplog.text) is warned


def test_a_second_sensor_in_the_topic_is_refused_and_reported_once(caplog):
    sweeps, reader = read([cloud(5.0, "front"), cloud(5.05, "rear"), cloud(5.1, "front"), cloud(5.15, "rear")])
    assert [sweep.frame_id for sweep in sweeps] == ["front", "front"]
    assert reader.reception.refused == {"another_sensor": 2}
    assert caplog.text.count("the topic has points in the frame 'rear' too") == 1


def test_messages_that_cannot_be_used_are_counted_by_their_reason_and_logged_once(caplog):
    huge = messages.encode(dataclasses.replace(messages.cloud(messages.xyzi(20)), width=2**32 - 1))
    sweeps, reader = read([b"", cloud(n=0), huge, huge, cloud()])
    assert len(sweeps) == 1
    assert reader.reception.messages == 5
    assert reader.reception.refused == {"malformed": 3, "empty": 1}
    assert caplog.text.count("message refused (malformed)") == 1


def test_sweeps_that_are_missing_by_their_stamps_are_counted_and_warned_of_once(caplog):
    _, reader = read(*([cloud(10.0 + k / 10)] for k in range(60) if k not in (20, 31, 32, 50)))
    assert reader.reception.lost == 4
    assert caplog.text.count("sweeps are missing by their stamps; raise net.core.rmem_max") == 1


def missing(stamps):
    counter = MissingSweeps()
    return [counter.before(stamp_s) for stamp_s in stamps]


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_lost_sweeps_are_counted_whatever_their_share(share, rng):
    kept = np.flatnonzero(rng.uniform(size=1000) > share)
    lost = kept[-1] - kept[0] + 1 - len(kept)
    assert sum(missing(kept * 0.05)) == pytest.approx(lost, abs=3)


def test_silence_and_a_clock_that_is_set_are_no_loss(rng):
    stamps = [*np.arange(20) / 10, *(100 + np.arange(20) / 10), *np.arange(20) / 10]
    assert sum(missing(stamps)) == 0
    assert sum(missing(0.1 * np.arange(500) + rng.uniform(-0.02, 0.02, 500))) == 0


def test_sweeps_that_are_sent_over_loopback_are_frames(loopback):
    live = open_sensor(f"ros2:///points?domain={NEAR}&reliability=reliable")
    live.start()
    sender = Sender(dds.participant(FAR))
    assert sender.wait_for_receiver(60.0)
    until(lambda: has_sender(live.reader._subscription))
    points = np.random.default_rng(0).uniform(0, 1, (100_000, 4)).astype(np.float32)
    sender.send(Frame(0, 0.0, points), 1000.5)
    received = live.take(60.0).frame
    np.testing.assert_array_equal(received.points, points)
    assert (received.stamp_s, received.frame_id) == (pytest.approx(1000.5), "lidar")
    assert (live.health()["lost_messages"], live.health()["dropped_sweeps"]) == (0, 0)
    live.close()


def test_a_sender_keeps_the_pace_of_the_stream():
    from modt_simulation.synthetic_stream import SyntheticStream

    stream = SyntheticStream("street", "vlp-16", 0.3, seed=0)
    sent = []
    frames, octets = pace(looped(stream, 2), lambda frame, stamp_s: sent.append(stamp_s) or 10, rate=50.0)
    assert (frames, octets) == (6, 60)
    np.testing.assert_allclose(np.diff(sent), 0.1, atol=1e-6)
