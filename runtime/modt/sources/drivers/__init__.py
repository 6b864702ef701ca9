"""Drivers of the sensors that send packets over UDP: one file a maker, imported when one of its sensors is used.

To add a maker, add a file `<maker>.py` with a `DRIVER`. Its name is the scheme of the addresses, `<maker>://HOST:PORT`.
`modt run` and `modt check` open such an address, `modt replay` recognises a capture, all by the same `Driver`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING

from modt.address import Address, Scheme
from modt.errors import MisuseError

if TYPE_CHECKING:
    from modt.sources.live.live_stream import LiveStream
    from modt.sources.packets.packet_decoder import PacketDecoder


@dataclass(frozen=True, kw_only=True)
class Driver:
    """Sensors of a maker.

    Attributes:
        maker: name of the maker in messages.
        port: UDP port to which its sensors send by default.
        recognises: whether a payload is a packet of points of this maker. A maker whose packets cannot be told from
            others without an option answers False, and names that option in `identified_by`.
        decoder: makes a decoder from the name of the source, its options, and the host of the sensor, which is asked
            for what the options lack. The host is "" where it is unknown. Raises a MisuseError for an invalid option.
        options: placeholder of the value of each option of addresses and captures, by name.
        identified_by: option that only sensors of this maker have.
        beside: suffix of the file with the name of a capture that an option defaults to, by option.
        extra: extra of modt that the decoder needs.
        described_at: UDP port to which the sensors send what they tell of themselves, 0 for none. The option `difop`
            of an address overrules it.
    """

    maker: str
    port: int
    recognises: Callable[[bytes], bool]
    decoder: Callable[[str, Mapping[str, str], str], PacketDecoder]
    options: Mapping[str, str] = field(default_factory=dict)
    identified_by: str = ""
    beside: Mapping[str, str] = field(default_factory=dict)
    extra: str = ""
    described_at: int = 0

    def scheme(self, name: str) -> Scheme:
        """Scheme of the addresses of these sensors."""
        described = {"difop": "PORT"} if self.described_at else {}
        options = {**self.options, **described, "group": "ADDRESS"}
        query = "&".join(f"{option}={value}" for option, value in options.items())
        return Scheme(f"{name}://[HOST][:PORT][?{query}]", self.open, frozenset(options), self.extra)

    def open(self, address: Address, cores: frozenset[int] | None) -> LiveStream:
        """Open the sensor at MAKER://[HOST][:PORT][?OPTION=VALUE&group=ADDRESS].

        HOST is the sensor, whose packets alone are used. PORT is the port of this machine, or of a multicast group,
        to which it sends them.
        """
        from modt.sources.live.live_stream import LiveStream
        from modt.sources.live.packets import PacketReader, address_of, bound_socket, port_of

        name = address.text
        decoder = self.decoder(name, address.options, address.host)
        source = address_of(name, address.host)
        bound = bound_socket(name, address.port or self.port, address.option("group"))
        reader = PacketReader(bound, decoder, source)
        if self.described_at:
            try:
                port = port_of(name, address.option("difop", str(self.described_at)))
                reader.descriptions = bound_socket(name, port, address.option("group"))
            except MisuseError:
                reader.close()
                raise
        return LiveStream(decoder.info(name, address.scheme), reader, cores=cores)

    def options_beside(self, capture: Path) -> dict[str, str]:
        """Options whose files have the name of a capture, where they exist."""
        files = {option: capture.with_suffix(suffix) for option, suffix in self.beside.items()}
        return {option: str(file) for option, file in files.items() if file.is_file()}


def names() -> list[str]:
    """Names of the files in this folder, which are the schemes of addresses."""
    return [module.name for module in iter_modules(__path__)]


def driver(name: str) -> Driver:
    """Driver of a file in this folder, which is imported."""
    found: Driver = import_module(f"{__name__}.{name}").DRIVER
    return found


def all_drivers() -> list[Driver]:
    """Drivers of all files in this folder, which are imported."""
    return [driver(name) for name in names()]
