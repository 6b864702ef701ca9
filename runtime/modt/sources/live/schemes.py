"""Live sensors by the scheme of their address."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

from modt.address import parse_address
from modt.sources.live.live_stream import LiveStream


@dataclass(frozen=True, slots=True)
class Scheme:
    """How the addresses of a scheme are opened.

    Attributes:
        opener: "module:function" of (Address, cores) to a LiveStream, imported when it is used: it may need an extra.
        options: that its addresses may have.
        form: of its addresses, for messages and help.
    """

    opener: str
    options: frozenset[str]
    form: str


SCHEMES = {
    "velodyne": Scheme(
        "modt.sources.live.packets:open_velodyne",
        frozenset({"model", "calibration", "group"}),
        "velodyne://[HOST][:PORT][?model=MODEL&calibration=FILE&group=ADDRESS]",
    ),
    "ouster": Scheme(
        "modt.sources.live.packets:open_ouster",
        frozenset({"metadata", "group"}),
        "ouster://[HOST][:PORT]?metadata=FILE[&group=ADDRESS]",
    ),
    "ros2": Scheme(
        "modt.sources.live.ros2:open_ros2",
        frozenset({"domain", "reliability"}),
        "ros2:///TOPIC[?domain=N&reliability=best_effort|reliable]",
    ),
}


def open_live(text: str, cores: frozenset[int] | None = None) -> LiveStream:
    """The sensor at an address, not yet started; `cores` as in LiveStream.

    Raises:
        MisuseError: an unknown scheme or option, a missing extra, or what cannot be bound or read.
    """
    address = parse_address(text, {name: scheme.options for name, scheme in SCHEMES.items()})
    module, _, function = SCHEMES[address.scheme].opener.partition(":")
    stream: LiveStream = getattr(import_module(module), function)(address, cores)
    return stream
