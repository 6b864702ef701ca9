"""UDP datagrams in PCAP files.

Files of either byte order with stamps in µs or ns are read; IPv4 and IPv6 over Ethernet, Linux cooked or raw IP.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from modt.errors import MisuseError
from modt.sources.packets.ip_packets import Fragments

MAGICS = {
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6),
    b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9),
    b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}
"""Byte order and unit of the stamps [s]."""
PCAPNG = b"\x0a\x0d\x0d\x0a"
"""First bytes of a pcapng file, which is not read."""
HEADER_BYTES = 24
"""Size of the header of a file."""
ETHERNET = 1
"""Link types: Ethernet, IP packets without a link layer, Linux cooked in both versions."""
RAW_IP = 101
COOKED = 113
COOKED_2 = 276
LINK_HEADERS = {ETHERNET: (12, 14), COOKED: (14, 16), COOKED_2: (0, 20)}
"""Offsets of the protocol and of the payload by link type."""
IP_PROTOCOLS = (0x0800, 0x86DD)
"""Protocols of IPv4 and IPv6 in the header of the link."""
VLAN_TAGS = (0x8100, 0x88A8, 0x9100)
UDP = 17
"""Protocol of UDP in an IP packet."""
UDP_BYTES = 8
"""Size of a header of UDP."""
MAX_RECORD_BYTES = 262_144
"""Greatest snapshot length of tcpdump; a record that promises more is broken."""


@dataclass(frozen=True, slots=True)
class Datagram:
    """A UDP datagram.

    Attributes:
        stamp_s: time of its capture [s since 1970].
        source: IP address of the sender.
        port: port of the receiver.
        payload: its bytes, fewer than were sent where the capture was cut short.
    """

    stamp_s: float
    source: str
    port: int
    payload: bytes


class PcapFile:
    """Datagrams of a file, in its order; packets of other protocols are skipped.

    Attributes:
        flow: source and port of the datagrams wanted; None selects all.
        flaw: reason why the last pass ended before the end of the file; None if it did not.
    """

    def __init__(self, path: Path) -> None:
        """Read the head of the file.

        Raises:
            MisuseError: the file cannot be read or is no PCAP file.
        """
        self.path = path
        self.flow: tuple[str, int] | None = None
        self.flaw: str | None = None
        try:
            with path.open("rb") as file:
                head = file.read(HEADER_BYTES)
        except OSError as error:
            raise MisuseError(path, f"cannot be read ({error.strerror})", "give a PCAP file") from None
        if head[:4] == PCAPNG:
            raise MisuseError(path, "is a pcapng file", "convert it: editcap -F pcap IN OUT")
        if head[:4] not in MAGICS or len(head) < HEADER_BYTES:
            raise MisuseError(path, "is no PCAP file", "record one: tcpdump -w FILE udp")
        self._order, self._unit_s = MAGICS[head[:4]]
        self._link = struct.unpack_from(self._order + "I", head, 20)[0] & 0xFFFF
        if self._link != RAW_IP and self._link not in LINK_HEADERS:
            raise MisuseError(path, f"link type {self._link} is unknown", "record it on an Ethernet interface")

    def __iter__(self) -> Iterator[Datagram]:
        self.flaw = None
        fragments = Fragments()
        with self.path.open("rb") as file:
            file.seek(HEADER_BYTES)
            for stamp_s, frame in self._records(file):
                start = self._start_of_ip(frame)
                packet = None if start is None else fragments.whole(frame[start:])
                if packet is None:
                    continue
                source, protocol, payload = packet
                if protocol != UDP or len(payload) < UDP_BYTES:
                    continue
                port, length = struct.unpack_from(">HH", payload, 2)
                if self.flow in (None, (source, port)):
                    yield Datagram(stamp_s, source, port, payload[UDP_BYTES : length or None])

    def _records(self, file: BinaryIO) -> Iterator[tuple[float, bytes]]:
        """Stamp [s] and bytes of each record up to the first broken one."""
        header = struct.Struct(self._order + "IIII")
        while head := file.read(header.size):
            if len(head) < header.size:
                self.flaw = "truncated within the header of a record"
                return
            second, fraction, length, _ = header.unpack(head)
            if length > MAX_RECORD_BYTES:
                self.flaw = f"a record promises {length} bytes: the rest of the file is not read"
                return
            frame = file.read(length)
            if len(frame) < length:
                self.flaw = "truncated within a record"
                return
            yield second + fraction * self._unit_s, frame

    def _start_of_ip(self, frame: bytes) -> int | None:
        """Offset of the IP header, None where there is none."""
        if self._link == RAW_IP:
            return 0
        protocol_at, start = LINK_HEADERS[self._link]
        while len(frame) >= start:
            protocol = int.from_bytes(frame[protocol_at : protocol_at + 2], "big")
            if protocol not in VLAN_TAGS:
                return start if protocol in IP_PROTOCOLS else None
            protocol_at = start + 2
            start += 4
        return None
