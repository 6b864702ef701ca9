"""Schemes of the addresses of sensors, sinks and senders of poses; the modules are imported when one is opened."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from modt.address import Address, Scheme, open_address

if TYPE_CHECKING:
    from modt.config import OdometryConfig
    from modt.poses.pose_source import PoseSource
    from modt.sinks.output import Sink
    from modt.sources.live.live_stream import LiveStream


def open_sensor(text: str, cores: frozenset[int] | None = None) -> LiveStream:
    """Open the sensor at an address without starting it; `cores` as in LiveStream.

    Raises:
        MisuseError: the scheme or an option is unknown, an extra is missing, or the address cannot be bound or read.
    """
    stream: LiveStream = open_address(text, SENSORS, cores)
    return stream


def open_sinks(texts: Iterable[str]) -> dict[str, Sink]:
    """Sinks by their addresses, each opened once; raises as `open_sink` does."""
    return {text: open_sink(text) for text in dict.fromkeys(texts)}


def open_sink(text: str) -> Sink:
    """Open the sink at an address, which never waits; "-" is standard output.

    Raises:
        MisuseError: the scheme or an option is unknown, or an extra is missing.
        ModtError: the address cannot be written.
    """
    sink: Sink = open_address("stdout://" if text == "-" else text, SINKS)
    return sink


def open_poses(text: str, config: OdometryConfig) -> PoseSource:
    """Receive the poses that are sent to an address.

    Raises:
        MisuseError: the scheme or an option is unknown, an extra is missing, or the address cannot be bound.
        ModtError: the domain of ROS 2 cannot be joined.
    """
    poses: PoseSource = open_address(text, POSES, config)
    return poses


def _opener(module: str, name: str) -> Callable[..., Any]:
    """Function of a module of modt, which is imported when an address is opened."""

    def opened(*arguments: object) -> Any:
        return getattr(import_module(f"modt.{module}"), name)(*arguments)

    return opened


def _background(module: str, name: str, depth: int) -> Callable[[Address], Sink]:
    """Opener of a writer that may wait; at most `depth` frames, with their points, wait for it."""

    def opened(address: Address) -> Sink:
        from modt.sinks.background import Background, StatusBackground
        from modt.sinks.output import StatusSink

        writer = _opener(module, name)(address)
        kind = StatusBackground if isinstance(writer, StatusSink) else Background
        return kind(address.text, writer, depth)

    return opened


def _pose_socket(address: Address, config: OdometryConfig) -> PoseSource:
    from modt.poses.pose_socket import PoseSocket, open_socket

    return PoseSocket(open_socket(address), config, address.text)


_TOPIC = Scheme(
    "ros2:///TOPIC[?domain=N&reliability=best_effort|reliable]",
    _opener("sources.live.ros2", "open_ros2"),
    frozenset({"domain", "reliability"}),
    "ros2",
)


class _Sensors(Mapping[str, Scheme]):
    """Schemes of sensors: of topics, and of each driver, which is imported when its scheme is asked for."""

    def __getitem__(self, name: str) -> Scheme:
        if name == "ros2":
            return _TOPIC
        from modt.sources import drivers

        if name not in drivers.names():
            raise KeyError(name)
        return drivers.driver(name).scheme(name)

    def __iter__(self) -> Iterator[str]:
        from modt.sources import drivers

        return iter([*drivers.names(), "ros2"])

    def __len__(self) -> int:
        return len([*self])


SENSORS = _Sensors()
_TOPICS = frozenset({"messages", "tracks", "points", "obstacles", "frame_id", "world_frame_id"})
SINKS = {
    "stdout": Scheme("stdout://", _opener("sinks.frame_lines", "open_stdout")),
    "file": Scheme("file:///PATH", _opener("sinks.frame_lines", "open_file")),
    "unix": Scheme("unix:///PATH", _opener("sinks.frame_lines", "open_unix")),
    "udp": Scheme("udp://HOST:PORT", _opener("sinks.frame_lines", "open_udp")),
    "mcap": Scheme(
        "mcap:///PATH",
        _background("sinks.foxglove_sinks", "open_mcap", 4),
        _TOPICS | {"max_mb"},
        "foxglove",
    ),
    "foxglove": Scheme(
        "foxglove://[HOST][:PORT]",
        _background("sinks.foxglove_sinks", "open_foxglove", 4),
        _TOPICS,
        "foxglove",
    ),
    "view": Scheme("view://[HOST][:PORT]", _background("viewer.live_page", "open_view", 6)),
    "ros2": Scheme("ros2:///PREFIX", _background("sinks.ros2", "open_ros2", 4), _TOPICS | {"domain"}, "ros2"),
}
POSES = {
    "udp": Scheme("udp://HOST:PORT", _pose_socket),
    "unix": Scheme("unix:///PATH", _pose_socket),
    "ros2": Scheme(
        "ros2:///TOPIC", _opener("poses.pose_topic", "open_topic"), frozenset({"domain", "base_to_sensor"}), "ros2"
    ),
}
