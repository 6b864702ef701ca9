"""Schemes of the addresses of sinks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Scheme:
    """How the addresses of a scheme are opened.

    Attributes:
        opener: "module:function" of an Address to a writer of frames, imported when it is used: it may need an extra.
        form: of its addresses, for messages and help.
        options: that its addresses may have.
        extra: of modt, that it needs.
        depth: frames, with their points, that may wait for it in the background; 0: it makes nobody wait.
    """

    opener: str
    form: str
    options: frozenset[str] = frozenset()
    extra: str = ""
    depth: int = 0


SCHEMES = {
    "stdout": Scheme("modt.sinks.frame_lines:open_stdout", "stdout://"),
    "file": Scheme("modt.sinks.frame_lines:open_file", "file:///PATH"),
    "unix": Scheme("modt.sinks.datagrams:open_unix", "unix:///PATH"),
    "udp": Scheme("modt.sinks.datagrams:open_udp", "udp://HOST:PORT"),
    "mcap": Scheme(
        "modt.sinks.mcap_file:open_mcap", "mcap:///PATH", frozenset({"points", "max_mb"}), "foxglove", depth=4
    ),
    "foxglove": Scheme(
        "modt.sinks.foxglove_server:open_foxglove",
        "foxglove://[HOST][:PORT]",
        frozenset({"points"}),
        "foxglove",
        depth=4,
    ),
    "view": Scheme("modt.viewer.live_page:open_view", "view://[HOST][:PORT]", depth=6),
    "ros2": Scheme(
        "modt.sinks.ros2:open_sink",
        "ros2:///PREFIX",
        frozenset({"domain", "frame_id", "world_frame_id"}),
        "ros2",
        depth=4,
    ),
}
