"""UDP datagrams in PCAP and pcapng files.

Files of either byte order with stamps in µs or ns are read; IPv4 and IPv6 over Ethernet, Linux cooked, loopback or
raw IP. Behind damaged bytes reading goes on at the next record.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from modt.errors import MisuseError
from modt.sources.packets.ip_packets import Fragments
from modt.sources.packets.pcapng_blocks import SECTION, Blocks, Captured

MAGICS = {
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6),
    b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9),
    b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}
"""Byte order and unit of the stamps [s]."""
HEADER_BYTES = 24
"""Size of the header of a file."""
ETHERNET = 1
"""Link types: Ethernet, IP packets without a link layer, Linux cooked in both versions."""
RAW_IP = 101
COOKED = 113
COOKED_2 = 276
LINK_HEADERS = {ETHERNET: (12, 14), COOKED: (14, 16), COOKED_2: (0, 20)}
"""Offsets of the protocol and of the payload by link type."""
IP_AT = {RAW_IP: 0, 12: 0, 14: 0, 228: 0, 229: 0, 0: 4, 108: 4}
"""Offset of the IP packet by link type: raw IP by its numbers on several systems, IPv4, IPv6, loopback."""
IP_PROTOCOLS = (0x0800, 0x86DD)
"""Protocols of IPv4 and IPv6 in the header of the link."""
VLAN_TAGS = (0x8100, 0x88A8, 0x9100)
UDP = 17
"""Protocol of UDP in an IP packet."""
UDP_BYTES = 8
"""Size of a header of UDP."""
MAX_RECORD_BYTES = 262_144
"""Greatest snapshot length of tcpdump; a record that promises more is broken."""
MAX_APART_S = 86_400
"""Greatest time between two records [s]; a header of one farther from the last record is broken."""


SEARCHED_BYTES = 1 << 22
"""Bytes behind a damage in which the next record is searched."""


def _flaw(numbers: tuple[int, ...], at: int, found: int | None, *, sound: bool) -> str:
    """Flaw of the record at an offset, after which one was found or none; `numbers` are () for a part of a header."""
    if found is None and not numbers:
        return "truncated within the header of a record"
    if found is None and sound:
        return "truncated within a record"
    absurd = bool(numbers) and numbers[2] > MAX_RECORD_BYTES
    cause = f"a record promises {numbers[2]} bytes" if absurd else "damaged"
    return f"{cause} at byte {at}" if found else f"{cause} from byte {at} on"


@dataclass(frozen=True)
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
        flaws: bytes that the last pass could not read, one line each.
        cut: number of datagrams of the last pass whose ends were not captured.
    """

    def __init__(self, path: Path) -> None:
        """Read the head of the file.

        Raises:
            MisuseError: the file cannot be read or is no PCAP file.
        """
        self.path = path
        self.flow: tuple[str, int] | None = None
        self.flaws: list[str] = []
        self.cut = 0
        self._blocks: Blocks | None = None  # those of a pcapng file
        try:
            with path.open("rb") as file:
                head = file.read(HEADER_BYTES)
        except OSError as error:
            raise MisuseError(path, f"cannot be read ({error.strerror})", "give a PCAP file") from None
        if head[:4] == SECTION:
            self._blocks = Blocks(path)
            return
        if head[:4] not in MAGICS or len(head) < HEADER_BYTES:
            raise MisuseError(path, "is no PCAP file", "record one: tcpdump -w FILE udp")
        self._order, self._unit_s = MAGICS[head[:4]]
        self._link = struct.unpack_from(self._order + "I", head, 20)[0] & 0xFFFF
        if self._link not in {*IP_AT, *LINK_HEADERS}:
            raise MisuseError(path, f"link type {self._link} is unknown", "record it on an Ethernet interface")

    def __iter__(self) -> Iterator[Datagram]:
        self.flaws = []
        self.cut = 0
        fragments = Fragments()
        for stamp_s, link, frame in self._captured():
            start = _start_of_ip(link, frame)
            packet = None if start is None else fragments.whole(frame[start:])
            if packet is None:
                continue
            source, protocol, payload = packet
            if protocol != UDP or len(payload) < UDP_BYTES:
                continue
            port, length = struct.unpack_from(">HH", payload, 2)
            if self.flow in (None, (source, port)):
                self.cut += len(payload) < length
                yield Datagram(stamp_s, source, port, payload[UDP_BYTES : length or None])

    def _captured(self) -> Iterator[Captured]:
        """Captured packets of the file."""
        if self._blocks is not None:
            yield from self._blocks
            self.flaws = self._blocks.flaws
            return
        with self.path.open("rb") as file:
            file.seek(HEADER_BYTES)
            for stamp_s, frame in self._records(file):
                yield Captured(stamp_s, self._link, frame)

    def _records(self, file: BinaryIO) -> Iterator[tuple[float, bytes]]:
        """Stamp [s] and bytes of each record."""
        header = struct.Struct(self._order + "IIII")
        at = HEADER_BYTES
        before = at  # begin of the last whole record, whose length may be wrong
        second: int | None = None
        while True:
            file.seek(at)
            head = file.read(header.size)
            if not head:
                return
            numbers = header.unpack(head) if len(head) == header.size else ()
            sound = bool(numbers) and self._is_header(numbers, second)
            frame = file.read(numbers[2]) if sound else b""
            if sound and len(frame) == numbers[2]:
                second = numbers[0]
                yield second + numbers[1] * self._unit_s, frame
                before = at
                at += header.size + len(frame)
                continue
            found = self._next_record(file, header, at + 1 if sound else before + 1, second, at)
            self.flaws.append(_flaw(numbers, at, found, sound=sound))
            if found is None:
                return
            before = at = found

    def _is_header(self, numbers: tuple[int, ...], second: int | None) -> bool:
        """Whether numbers can be the header of the record after one of a second."""
        now, fraction, length, original = numbers
        near = second is None or abs(now - second) <= MAX_APART_S
        return near and length <= min(original, MAX_RECORD_BYTES) and fraction * self._unit_s < 1.0

    def _next_record(
        self, file: BinaryIO, header: struct.Struct, start: int, second: int | None, beyond: int
    ) -> int | None:
        """Offset, from `start` on, of a record that ends with the file or where another one begins; None without one.

        A record within what was read before counts only if it does not begin at `beyond`, the damaged place.
        """
        file.seek(start)
        data = file.read(SEARCHED_BYTES)
        size = start + len(data)
        for at in range(len(data) - header.size + 1):
            numbers = header.unpack_from(data, at)
            if start + at == beyond or numbers[2] == 0 or not self._is_header(numbers, second):
                continue
            end = at + header.size + numbers[2]
            last = end == len(data) and size == self.path.stat().st_size
            follows = end + header.size <= len(data) and self._is_header(header.unpack_from(data, end), second)
            if last or follows:
                return start + at
        return None


def _start_of_ip(link: int, frame: bytes) -> int | None:
    """Offset of the IP header in a frame of a type of link, None where there is none."""
    if link in IP_AT:
        return IP_AT[link]
    protocol_at, start = LINK_HEADERS.get(link, (0, len(frame) + 1))
    while len(frame) >= start:
        protocol = int.from_bytes(frame[protocol_at : protocol_at + 2], "big")
        if protocol not in VLAN_TAGS:
            return start if protocol in IP_PROTOCOLS else None
        protocol_at = start + 2
        start += 4
    return None
