"""Rows of a rosbag2 database by its pages, where SQLite cannot find its way to them.

The format is that of https://www.sqlite.org/fileformat2.html. A row of `messages` is told by its shape: no number of
its own (the row has it), two whole numbers, and bytes. A row of `topics` has texts instead.
"""

from __future__ import annotations

import mmap
from itertools import pairwise
from pathlib import Path
from typing import Any

PAGE_BYTES = (4096, 1024, 2048, 8192, 16_384, 32_768, 65_536)
"""Sizes of a page that are tried where the header of the file is damaged."""
RESERVED_AT = 20
"""Offset in the file of the number of bytes of each page that are not used."""
FILE_HEADER_BYTES = 100
LEAF = 13
"""Kind of a page that holds rows of a table."""
MIN_PAGE_BYTES = 512
MAX_PAGE_BYTES = 65_536
INTEGER_BYTES = {0: 0, 1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 8: 0, 9: 0}
"""Size of the values of each type that is no text and no bytes; 0 is no value, 8 and 9 are the numbers 0 and 1."""
FIRST_BYTES = 12
"""Types from this one on are bytes if they are even, else texts; the size follows from the type."""
MAX_COLUMNS = 16
MAX_FORM_CHARACTERS = 16
"""Longest name of an encoding of messages."""


class Pages:
    """Rows of the topics and the messages.

    Attributes:
        topics: number, name, type and encoding of each topic.
        messages: time [ns], number, and number of the topic of each message.
    """

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            self._view = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self.topics: list[tuple[Any, ...]] = []
        self.messages: list[tuple[int, int, int]] = []
        self._cells: dict[int, tuple[int, int]] = {}  # place of the row of each message, and offset of its bytes
        stated = int.from_bytes(self._view[16:18], "big")
        for page_bytes in dict.fromkeys((MAX_PAGE_BYTES if stated == 1 else stated, *PAGE_BYTES)):
            if page_bytes >= MIN_PAGE_BYTES and not page_bytes & (page_bytes - 1) and not self.messages:
                self._page_bytes = page_bytes
                self._usable = page_bytes - self._view[RESERVED_AT]
                self.topics.clear()
                self._read()

    def blob(self, number: int) -> bytes | None:
        """Bytes of a message; None if their pages are not all there."""
        if number not in self._cells:
            return None
        place, offset = self._cells[number]
        payload = self._payload(place)
        return None if payload is None else payload[offset:]

    def _read(self) -> None:
        for page in range(0, len(self._view), self._page_bytes):
            head = page + (FILE_HEADER_BYTES if page == 0 else 0)
            if head + 8 > len(self._view) or self._view[head] != LEAF:
                continue
            for k in range(min(self._number(head + 3, 2), self._page_bytes // 4)):
                try:
                    self._add(page + self._number(head + 8 + 2 * k, 2))
                except (IndexError, KeyError, UnicodeDecodeError):
                    continue  # a damaged row

    def _add(self, place: int) -> None:
        """Add the row at a place of the file, if it is one of the two tables.

        Raises:
            IndexError, KeyError, UnicodeDecodeError: it is damaged.
        """
        size, at = self._varint(place)
        number, at = self._varint(at)
        header_bytes, types_at = self._varint(at)
        types: list[int] = []
        while types_at < at + header_bytes and len(types) < MAX_COLUMNS:
            kind, types_at = self._varint(types_at)
            types.append(kind)
        sizes = [INTEGER_BYTES[kind] if kind < FIRST_BYTES else (kind - FIRST_BYTES) // 2 for kind in types]
        if len(types) < 4 or types[0] != 0 or header_bytes + sum(sizes) != size:
            return
        shapes = [0 if kind < FIRST_BYTES else 1 + kind % 2 for kind in types[1:4]]
        values_at = at + header_bytes
        if shapes == [0, 0, 1] and len(types) == 4 and number not in self._cells:
            topic = self._integer(types[1], values_at)
            recorded_ns = self._integer(types[2], values_at + sizes[1])
            self.messages.append((recorded_ns, number, topic))
            self._cells[number] = (place, header_bytes + sizes[1] + sizes[2])
        elif shapes == [2, 2, 2]:
            ends = [values_at + sum(sizes[:k]) for k in range(1, 5)]
            name, of, form = (self._view[a:b].decode() for a, b in pairwise(ends))
            if "/" in of and len(form) <= MAX_FORM_CHARACTERS:  # a definition of messages has a long text there
                self.topics.append((number, name, of, form))

    def _payload(self, place: int) -> bytes | None:
        """Record of the row at a place of the file, with what overflows its page; None if that is not all there."""
        size, at = self._varint(place)
        _, at = self._varint(at)
        if size > len(self._view):
            return None
        most = self._usable - 35
        least = (self._usable - 12) * 32 // 255 - 23
        local = size
        if size > most:
            local = least + (size - least) % (self._usable - 4)
            local = local if local <= most else least
        parts = [self._view[at : at + local]]
        left = size - local
        page = self._number(at + local, 4)
        while left > 0:
            begin = (page - 1) * self._page_bytes
            part = self._view[begin + 4 : begin + min(self._usable, 4 + left)] if page else b""
            if not part:
                return None
            parts.append(part)
            left -= len(part)
            page = self._number(begin, 4)
        return b"".join(parts)

    def _varint(self, at: int) -> tuple[int, int]:
        """A number of one to nine bytes, and the place behind it."""
        value = 0
        for k in range(9):
            byte = self._view[at + k]
            if k == 8:
                return value << 8 | byte, at + 9
            value = value << 7 | byte & 127
            if byte < 128:
                return value, at + k + 1
        raise IndexError

    def _integer(self, kind: int, at: int) -> int:
        if kind in (8, 9):
            return kind - 8
        return int.from_bytes(self._view[at : at + INTEGER_BYTES[kind]], "big", signed=True)

    def _number(self, at: int, size: int) -> int:
        return int.from_bytes(self._view[at : at + size], "big")
