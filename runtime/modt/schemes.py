"""Schemes of addresses: sensors, sinks and senders of poses; only what is opened is imported."""

from __future__ import annotations

from typing import TYPE_CHECKING

from modt.address import Address, Scheme, open_address

if TYPE_CHECKING:
    from modt.config import OdometryConfig
    from modt.sinks.output import Sink, Writer
    from modt.sources.live.live_stream import LiveStream
    from modt.sources.pose_source import PoseSource
    from modt.types import FrameResult


def open_sensor(text: str, cores: frozenset[int] | None = None) -> LiveStream:
    """The sensor at an address, not yet started; `cores` as in LiveStream.

    Raises:
        MisuseError: an unknown scheme or option, a missing extra, or what cannot be bound or read.
    """
    stream: LiveStream = open_address(text, SENSORS, cores)
    return stream


def open_sink(text: str) -> Sink:
    """The sink at an address, which never waits; "-" is standard output.

    Raises:
        MisuseError: an unknown scheme or option, or a missing extra.
        ModtError: what cannot be written.
    """
    sink: Sink = open_address("stdout://" if text == "-" else text, SINKS)
    return sink


def open_poses(text: str, config: OdometryConfig) -> PoseSource:
    """The poses that are sent to an address.

    Raises:
        MisuseError: an unknown scheme or option, a missing extra, or what cannot be bound.
        ModtError: a domain of ROS 2 that cannot be joined.
    """
    poses: PoseSource = open_address(text, POSES, config)
    return poses


def _velodyne(address: Address, cores: frozenset[int] | None) -> LiveStream:
    from modt.sources.live.packets import open_velodyne

    return open_velodyne(address, cores)


def _ouster(address: Address, cores: frozenset[int] | None) -> LiveStream:
    from modt.sources.live.packets import open_ouster

    return open_ouster(address, cores)


def _point_clouds(address: Address, cores: frozenset[int] | None) -> LiveStream:
    from modt.sources.live.ros2 import open_ros2

    return open_ros2(address, cores)


def _stdout(address: Address) -> Sink:
    from modt.sinks.frame_lines import open_stdout

    return open_stdout(address)


def _file(address: Address) -> Sink:
    from modt.sinks.frame_lines import open_file

    return open_file(address)


def _unix(address: Address) -> Sink:
    from modt.sinks.datagrams import open_unix

    return open_unix(address)


def _udp(address: Address) -> Sink:
    from modt.sinks.datagrams import open_udp

    return open_udp(address)


def _mcap(address: Address) -> Sink:
    from modt.sinks.mcap_file import open_mcap

    return _in_background(address, open_mcap(address), 4)


def _foxglove(address: Address) -> Sink:
    from modt.sinks.foxglove_server import open_foxglove

    return _in_background(address, open_foxglove(address), 4)


def _view(address: Address) -> Sink:
    from modt.viewer.live_page import open_view

    return _in_background(address, open_view(address), 6)


def _detections(address: Address) -> Sink:
    from modt.sinks.ros2 import open_ros2

    return _in_background(address, open_ros2(address), 4)


def _in_background(address: Address, writer: Writer[FrameResult], depth: int) -> Sink:
    """A sink for a writer that may wait; `depth` frames, with their points, wait for it at most."""
    from modt.sinks.background import Background

    return Background(address.text, writer, depth)


def _pose_socket(address: Address, config: OdometryConfig) -> PoseSource:
    from modt.sources.pose_socket import PoseSocket, open_socket

    return PoseSocket(open_socket(address), config, address.text)


def _pose_topic(address: Address, config: OdometryConfig) -> PoseSource:
    from modt.sources.pose_topic import open_topic

    return open_topic(address, config)


SENSORS = {
    "velodyne": Scheme(
        "velodyne://[HOST][:PORT][?model=MODEL&calibration=FILE&group=ADDRESS]",
        _velodyne,
        frozenset({"model", "calibration", "group"}),
        "velodyne",
    ),
    "ouster": Scheme(
        "ouster://[HOST][:PORT]?metadata=FILE[&group=ADDRESS]", _ouster, frozenset({"metadata", "group"}), "ouster"
    ),
    "ros2": Scheme(
        "ros2:///TOPIC[?domain=N&reliability=best_effort|reliable]",
        _point_clouds,
        frozenset({"domain", "reliability"}),
        "ros2",
    ),
}
_DETECTIONS = frozenset({"domain", "frame_id", "world_frame_id", "tracks"})
SINKS = {
    "stdout": Scheme("stdout://", _stdout),
    "file": Scheme("file:///PATH", _file),
    "unix": Scheme("unix:///PATH", _unix),
    "udp": Scheme("udp://HOST:PORT", _udp),
    "mcap": Scheme("mcap:///PATH", _mcap, frozenset({"points", "max_mb"}), "foxglove"),
    "foxglove": Scheme("foxglove://[HOST][:PORT]", _foxglove, frozenset({"points"}), "foxglove"),
    "view": Scheme("view://[HOST][:PORT]", _view),
    "ros2": Scheme("ros2:///PREFIX", _detections, _DETECTIONS, "ros2"),
}
POSES = {
    "udp": Scheme("udp://HOST:PORT", _pose_socket),
    "unix": Scheme("unix:///PATH", _pose_socket),
    "ros2": Scheme("ros2:///TOPIC", _pose_topic, frozenset({"domain", "base_to_sensor"}), "ros2"),
}
