"""Packets in the blocks of pcapng files, as Wireshark and its tools write them.

The format is that of https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-03.html. A block has its length at both
ends. Behind damaged bytes reading goes on at the next packet.
"""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

SECTION = b"\x0a\x0d\x0d\x0a"
"""Kind of the block that begins a section, the same in either byte order."""
LITTLE_ENDIAN = b"\x4d\x3c\x2b\x1a"
"""Magic behind the length of such a block in a little-endian section."""
INTERFACE = 1
PACKET = 6
"""Kinds of blocks. Packets without a stamp (kind 3) are not read."""
BLOCK_BYTES = 12
"""Size of an empty block."""
MAX_BLOCK_BYTES = 1 << 22
RESOLUTION, OFFSET = 9, 14
"""Options of an interface: exponent of the unit of its stamps, and seconds to add to them."""
RESOLUTION_S = 1e-6


class Captured(NamedTuple):
    """A packet: time of its capture [s since 1970], type of its link, and its bytes."""

    stamp_s: float
    link: int
    frame: bytes


@dataclass(frozen=True)
class Interface:
    """Type of the link, unit of the stamps [s], and seconds to add to them."""

    link: int
    unit_s: float
    offset_s: int


class Blocks:
    """The packets of a file.

    Attributes:
        flaws: bytes that the last pass could not read, one line each.
    """

    def __init__(self, path: Path) -> None:
        self.flaws: list[str] = []
        self._path = path
        self._order = "<"
        self._interfaces: list[Interface] = []

    def __iter__(self) -> Iterator[Captured]:
        self.flaws.clear()
        self._interfaces = []
        with self._path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as view:
            at = 0
            while at < len(view):
                end = self._end(view, at)
                if end is None:
                    found = self._next_packet(view, at + 1)
                    self.flaws.append(f"damaged at byte {at}" if found else f"truncated or damaged from byte {at} on")
                    at = found or len(view)
                    continue
                packet = self._packet(view, at, end)
                if packet is not None:
                    yield packet
                at = end

    def _end(self, view: mmap.mmap, at: int) -> int | None:
        """End of the block at an offset, None where there is no whole one. A section decides on the byte order."""
        if at + BLOCK_BYTES > len(view):
            return None
        begins = view[at : at + 4] == SECTION
        order = self._order
        if begins:
            order = "<" if view[at + 8 : at + 12] == LITTLE_ENDIAN else ">"
        (size,) = struct.unpack_from(order + "I", view, at + 4)
        end = int(at + size)
        whole = BLOCK_BYTES <= size <= MAX_BLOCK_BYTES and view[end - 4 : end] == view[at + 4 : at + 8]
        if not whole:
            return None
        if begins:
            self._order = order
            self._interfaces = []
        return end

    def _next_packet(self, view: mmap.mmap, start: int) -> int | None:
        """Offset, from `start` on, of the next whole block of a packet or a section; None without one."""
        begin = re.compile(re.escape(struct.pack(self._order + "I", PACKET)) + b"|" + re.escape(SECTION))
        places = (match.start() for match in begin.finditer(view, start))
        return next((at for at in places if self._end(view, at) is not None), None)

    def _packet(self, view: mmap.mmap, at: int, end: int) -> Captured | None:
        """The packet in a block; None if it has none, as that of an interface, which is kept."""
        (kind,) = struct.unpack_from(self._order + "I", view, at)
        body = view[at + 8 : end - 4]
        if kind == INTERFACE and len(body) >= 8:
            self._interfaces.append(self._interface(body))
        elif kind == PACKET and len(body) >= 20:
            number, high, low, size, _ = struct.unpack_from(self._order + "5I", body)
            if number < len(self._interfaces):
                interface = self._interfaces[number]
                stamp_s = interface.offset_s + (high << 32 | low) * interface.unit_s
                return Captured(stamp_s, interface.link, body[20 : 20 + size])
        return None

    def _interface(self, body: bytes) -> Interface:
        """The interface in the body of its block."""
        (link,) = struct.unpack_from(self._order + "H", body)
        unit_s = RESOLUTION_S
        offset_s = 0
        at = 8
        while at + 4 <= len(body):
            code, size = struct.unpack_from(self._order + "HH", body, at)
            value = body[at + 4 : at + 4 + size]
            if code == RESOLUTION and size == 1:
                unit_s = 2.0 ** -(value[0] & 127) if value[0] & 128 else 10.0 ** -value[0]
            elif code == OFFSET and len(value) == 8:
                (offset_s,) = struct.unpack(self._order + "q", value)
            at += 4 + size + -size % 4
        return Interface(link, unit_s, offset_s)
