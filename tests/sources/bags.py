"""Small recordings of ROS 2, for tests."""

import itertools

from mcap.writer import Writer as McapWriter
from rosbags import rosbag2

from tests.ros2 import messages

CLOUD = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
TF = "tf2_msgs/msg/TFMessage"
BEGAN_S = 1_700_000_000.0
UP = [0.0, 0.0, 0.0, 1.0]
TWENTY = messages.xyzi(20)
Recorded = list[tuple[str, str, float, bytes]]
"""Topic, type, time of the recording, message."""


def write_rosbag2(path, recorded, compressed=None):
    """A folder; compressed with zstd as a "file" or by "message"."""
    writer = rosbag2.Writer(path, version=8)
    if compressed is not None:
        writer.set_compression(rosbag2.CompressionMode[compressed.upper()], rosbag2.CompressionFormat.ZSTD)
    with writer as bag:
        connections = {}
        for topic, kind, recorded_s, data in recorded:
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=messages.store())
            bag.write(connections[topic], round(recorded_s * 1e9), data)
    return path


def write_mcap(path, recorded, **options):
    path = path.with_suffix(".mcap")
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start("ros2")
        channels = {}
        for topic, kind, recorded_s, data in recorded:
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], round(recorded_s * 1e9), data, round(recorded_s * 1e9))
        writer.finish()
    return path


def clouds(n=4, topic="/points"):
    """Sweeps 0.1 s apart, recorded 30 ms after their stamps."""
    stamps = [BEGAN_S + k / 10 for k in range(n)]
    return [sweep(s + 0.03, messages.xyzi(20 + k), topic, stamp_s=s) for k, s in enumerate(stamps)]


def sweep(recorded_s, points=TWENTY, topic="/points", **options):
    """A recorded message of points."""
    return (topic, CLOUD, recorded_s, messages.encode(messages.cloud(points, **options)))


def poses(child="lidar", topic="/odom"):
    """Poses at 50 Hz of a sensor that moves along x at 1 m/s, from 0.2 s before the first sweep."""
    stamps = [BEGAN_S + k / 50 - 0.21 for k in range(40)]
    made = [messages.odometry(s, [10.0 + s - BEGAN_S, 0.0, 0.0], UP, child) for s in stamps]
    return [(topic, ODOMETRY, s + 0.001, messages.encode(m)) for s, m in zip(stamps, made, strict=True)]


def by_time(*recorded):
    return sorted(itertools.chain(*recorded), key=lambda message: message[2])
