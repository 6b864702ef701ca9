"""UDP datagrams of PCAP files of either byte order, µs or ns; IPv4 or IPv6 over Ethernet, Linux cooked or raw IP."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from modt.errors import MisuseError

MAX_PENDING = 64
"""Greatest number of incomplete packets; beyond it the oldest one is dropped."""
MORE, OFFSET = 0x2000, 0x1FFF
MAX_PACKET_BYTES = 65_535
IPV6_BYTES, FRAGMENT = 40, 44
EXTENSIONS = (0, 43, FRAGMENT, 60)
"""Extension headers of IPv6: hop by hop, routing, fragment, destination."""


Packet = tuple[str, int, bytes]
"""Source, protocol and payload of a whole IP packet."""


class Fragments:
    """Joins the fragments of IP packets, with bounded memory."""

    def __init__(self) -> None:
        self._pending: dict[bytes, dict[int, tuple[bytes, bool]]] = {}

    def whole(self, raw: bytes) -> Packet | None:
        """Packet that these bytes of an IP packet complete, None while a part is missing or if they are none."""
        version = raw[0] >> 4 if raw else 0
        if version == 6 and len(raw) >= IPV6_BYTES:
            return self._whole_of_ipv6(raw)
        if version != 4 or len(raw) < 20:
            return None
        start, length = 4 * (raw[0] & 15), int.from_bytes(raw[2:4], "big")
        flags = struct.unpack_from(">H", raw, 6)[0]
        key = raw[12:20] + raw[4:6] + raw[9:10]
        payload = self._joined(key, 8 * (flags & OFFSET), raw[start : length or None], bool(flags & MORE))
        return None if payload is None else (".".join(map(str, raw[12:16])), raw[9], payload)

    def _whole_of_ipv6(self, raw: bytes) -> Packet | None:
        length, kind, payload = int.from_bytes(raw[4:6], "big"), raw[6], raw[IPV6_BYTES:]
        whole: bytes | None = payload[: length or None]
        while whole and kind in EXTENSIONS and len(whole) >= 8:
            kind, extension, size = whole[0], kind, 8 if kind == FRAGMENT else 8 * (whole[1] + 1)
            where, key, whole = int.from_bytes(whole[2:4], "big"), raw[8:IPV6_BYTES] + whole[4:8], whole[size:]
            if extension == FRAGMENT:
                whole = self._joined(key, where & ~7, whole, bool(where & 1))
        return None if whole is None else (socket.inet_ntop(socket.AF_INET6, raw[8:24]), kind, whole)

    def _joined(self, key: bytes, offset: int, payload: bytes, more: bool) -> bytes | None:
        """Payload that a fragment completes, None while a part is missing."""
        if not offset and not more:
            return payload
        parts = self._pending.setdefault(key, {})
        parts[offset] = (payload, more)
        out, at = b"", 0
        while at in parts and len(out) <= MAX_PACKET_BYTES:
            part, more = parts[at]
            out, at = out + part, at + len(part)
            if not more:
                del self._pending[key]
                return out
            if not part:
                break
        if len(self._pending) > MAX_PENDING:
            del self._pending[next(iter(self._pending))]
        return None


MAGICS = {
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6),
    b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9),
    b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}
"""Byte order and unit of the stamps [s]."""
PCAPNG = b"\x0a\x0d\x0d\x0a"
ETHERNET, RAW_IP, COOKED, COOKED_2 = 1, 101, 113, 276
LINK_HEADERS = {ETHERNET: (12, 14), COOKED: (14, 16), COOKED_2: (0, 20)}
"""Offsets of the protocol and of the payload by link type."""
IPS, VLAN_TAGS, UDP = (0x0800, 0x86DD), (0x8100, 0x88A8, 0x9100), 17
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


class Capture:
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
                head = file.read(24)
        except OSError as error:
            raise MisuseError(path, f"cannot be read ({error.strerror})", "give a PCAP file") from None
        if head[:4] == PCAPNG:
            raise MisuseError(path, "is a pcapng file", "convert it: editcap -F pcap IN OUT")
        if head[:4] not in MAGICS or len(head) < 24:
            raise MisuseError(path, "is no PCAP file", "record one: tcpdump -w FILE udp")
        self._order, self._unit_s = MAGICS[head[:4]]
        self._link = struct.unpack_from(self._order + "I", head, 20)[0] & 0xFFFF
        if self._link != RAW_IP and self._link not in LINK_HEADERS:
            raise MisuseError(path, f"link type {self._link} is unknown", "record it on an Ethernet interface")

    def __iter__(self) -> Iterator[Datagram]:
        self.flaw, fragments = None, Fragments()
        with self.path.open("rb") as file:
            file.seek(24)
            for stamp_s, frame in self._records(file):
                start = self._start_of_ip(frame)
                source, protocol, payload = (start is not None and fragments.whole(frame[start:])) or ("", 0, b"")
                if protocol != UDP or len(payload) < 8:
                    continue
                port, length = struct.unpack_from(">HH", payload, 2)
                if self.flow in (None, (source, port)):
                    yield Datagram(stamp_s, source, port, payload[8 : length or None])

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
                return start if protocol in IPS else None
            protocol_at, start = start + 2, start + 4
        return None
