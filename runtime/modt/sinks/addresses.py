"""Sinks by the scheme of their address."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

from modt.address import parse_address
from modt.errors import MisuseError
from modt.sinks.output import Sink


@dataclass(frozen=True, slots=True)
class Scheme:
    """How the addresses of a scheme are opened.

    Attributes:
        opener: "module:function" of an Address to a Sink that never waits, imported when it is used.
        form: of its addresses, for messages and help.
        options: that its addresses may have.
        extra: of modt, that it needs.
    """

    opener: str
    form: str
    options: frozenset[str] = frozenset()
    extra: str = ""


SCHEMES = {
    "stdout": Scheme("modt.sinks.frame_lines:open_stdout", "stdout://"),
    "file": Scheme("modt.sinks.frame_lines:open_file", "file:///PATH"),
    "unix": Scheme("modt.sinks.datagrams:open_unix", "unix:///PATH"),
    "udp": Scheme("modt.sinks.datagrams:open_udp", "udp://HOST:PORT"),
    "mcap": Scheme("modt.sinks.mcap_file:open_mcap", "mcap:///PATH", frozenset({"points", "max_mb"}), "foxglove"),
    "foxglove": Scheme(
        "modt.sinks.foxglove_server:open_foxglove", "foxglove://[HOST][:PORT]", frozenset({"points"}), "foxglove"
    ),
    "ros2": Scheme("modt.sinks.ros2:open_sink", "ros2://", frozenset({"domain", "prefix", "frame"}), "ros2"),
}


def open_sink(text: str) -> Sink:
    """The sink at an address; "-" is standard output.

    Raises:
        MisuseError: an unknown scheme or option, or a missing extra.
        ModtError: what cannot be written.
    """
    address = parse_address("stdout://" if text == "-" else text, {name: s.options for name, s in SCHEMES.items()})
    scheme = SCHEMES[address.scheme]
    module, _, function = scheme.opener.partition(":")
    try:
        opener = getattr(import_module(module), function)
    except ModuleNotFoundError as error:
        raise MisuseError(text, f"needs {error.name}", f"pip install 'modt[{scheme.extra}]'") from None
    sink: Sink = opener(address)
    return sink
