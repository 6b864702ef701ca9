"""Results on topics of ROS 2, over loopback."""

import pytest

from modt.address import parse_address
from modt.schemes import SINKS
from tests.results import CAR, result, with_kinds
from tests.ros2.network import FAR, NEAR, has_sender, until

pytest.importorskip("cyclonedds")
from modt.ros2 import dds
from modt.sinks.ros2 import open_ros2

FRAME = with_kinds(result(3, [5, 4], {0: 1, 1: 12}, {1: CAR}))


def test_a_frame_is_published_to_its_subscribers(loopback):
    address = f"ros2:///robot?domain={NEAR}&frame_id=velodyne&world_frame_id=map&tracks=all&obstacles=all"
    sink = open_ros2(parse_address(address, SINKS))
    names = [topic.name for topic, _ in sink.topics]
    assert names == [
        "/robot/detections",
        "/robot/markers",
        "/robot/odometry",
        "/robot/diagnostics",
        "/tf",
        "/robot/obstacles",
        "/robot/ground",
    ]
    joined = dds.participant(FAR)
    heard = {t.name: dds.Subscription(joined, t.name, t.type, depth=1, reliable=True) for t, _ in sink.topics}
    until(lambda: all(publication.receivers for _, publication in sink.topics))
    until(lambda: all(map(has_sender, heard.values())))
    sink.write(FRAME)
    for topic, _ in sink.topics:
        assert [message.data for message in heard[topic.name].take(60.0)] == [topic.encode(FRAME)]
    assert b"velodyne" in sink.topics[0][0].encode(FRAME)
    assert b"background" in sink.topics[0][0].encode(result(0, [5], {0: 1}))
    assert sink.health() == {"unsent": 0}
    sink.close()
    sink.write(FRAME)
