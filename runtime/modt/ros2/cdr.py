"""Plain CDR (XCDR version 1), the encoding of ROS 2 messages."""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np

from modt.types import Float64

HEADER_BYTES = 4
"""Encapsulation header with the byte order; alignment counts from its end."""
MAX_ALIGNMENT = 8
INT32_MAX = 2**31 - 1
MAX_TEXT_BYTES = 4096
"""Longest string that is accepted."""


class MessageError(ValueError):
    """Bytes that are not a usable message, and the reason under which they are counted."""

    def __init__(self, reason: str, cause: str) -> None:
        super().__init__(cause)
        self.reason = reason


class CdrReader:
    """Reads the fields of a message in order, and never beyond its end.

    Raises:
        MessageError: `malformed`: another encapsulation, or lengths beyond the message.
    """

    def __init__(self, message: bytes) -> None:
        if len(message) < HEADER_BYTES or message[0] != 0 or message[1] > 1:
            raise MessageError("malformed", "it is not encoded in plain CDR")
        self._message = memoryview(message)
        self._at = HEADER_BYTES
        self.order = "<" if message[1] else ">"

    def number(self, code: str) -> int | float:
        """A number of the type of a format character of `struct`."""
        size = struct.calcsize(code)
        value: int | float = struct.unpack(self.order + code, self._bytes(size, size))[0]
        return value

    def count(self) -> int:
        """An unsigned 32-bit integer."""
        return int(self.number("I"))

    def text(self) -> str:
        """A string."""
        length = self.count()
        if length > MAX_TEXT_BYTES:
            raise MessageError("malformed", f"a string of {length} bytes")
        return bytes(self._bytes(length)).rstrip(b"\0").decode("utf-8", "replace")

    def octets(self) -> memoryview:
        """A sequence of octets, not copied."""
        return self._bytes(self.count())

    def rest(self) -> memoryview:
        """Bytes that follow, not copied."""
        return self._message[self._at :]

    def doubles(self, n: int) -> Float64:
        """(n,) 64-bit numbers."""
        return np.frombuffer(self._bytes(8 * n, 8), self.order + "f8").astype(np.float64)

    def stamp_s(self) -> float:
        """A builtin_interfaces/Time [s]."""
        seconds = self.number("i")
        return seconds + 1e-9 * self.count()

    def header(self) -> tuple[float, str]:
        """Stamp [s] and frame of a std_msgs/Header."""
        stamp_s = self.stamp_s()
        return stamp_s, self.text()

    def _bytes(self, size: int, alignment: int = 1) -> memoryview:
        begin = self._at + -(self._at - HEADER_BYTES) % alignment
        if begin + size > len(self._message):
            raise MessageError("malformed", f"{len(self._message)} bytes end within a field")
        self._at = begin + size
        return self._message[begin : self._at]


class CdrWriter:
    """Writes a message in little-endian byte order, record by record.

    A record is described by its fields, format characters of `struct` with a count before them (`7d`), which are
    aligned as in CDR. A string takes two, `I` and `{n}s`: its length, and its bytes with a zero.
    """

    def __init__(self) -> None:
        self._message = bytearray(b"\0\1\0\0")

    def record(self, fields: tuple[str, ...], *values: float | bytes) -> None:
        """Append a record."""
        phase = (len(self._message) - HEADER_BYTES) % MAX_ALIGNMENT
        self._message += _layout(fields, phase).pack(*values)

    def text(self, text: str) -> None:
        """Append a string."""
        fields, values = text_fields(text)
        self.record(fields, *values)

    def octets(self, octets: bytes | memoryview) -> None:
        """Append a sequence of octets."""
        self.record(("I",), len(octets))
        self._message += octets

    def header(self, stamp_s: float, frame_id: str) -> None:
        """Append a std_msgs/Header."""
        fields, values = header_fields(stamp_s, frame_id)
        self.record(fields, *values)

    def message(self) -> bytes:
        """The whole message, padded to a multiple of four bytes as DDS requires it."""
        self._message += bytes(-len(self._message) % 4)
        return bytes(self._message)


Fields = tuple[tuple[str, ...], tuple[float | bytes, ...]]
"""Fields of a part of a record, and their values."""


def text_fields(text: str) -> Fields:
    """Length and bytes of a string."""
    octets = text.encode() + b"\0"
    return ("I", f"{len(octets)}s"), (len(octets), octets)


def header_fields(stamp_s: float, frame_id: str) -> Fields:
    """A std_msgs/Header. Its seconds have 31 bits: a stamp beyond is the latest one that it can hold."""
    fields, values = text_fields(frame_id)
    seconds, nanoseconds = divmod(round(stamp_s * 1e9), 10**9)
    return ("i", "I", *fields), (min(seconds, INT32_MAX), nanoseconds, *values)


@lru_cache(maxsize=1024)
def _layout(fields: tuple[str, ...], phase: int) -> struct.Struct:
    """Layout of a record that begins `phase` bytes behind a multiple of the greatest alignment."""
    at = phase
    text = "<"
    for field in fields:
        gap = -at % struct.calcsize("<" + field[-1])
        text += f"{gap}x{field}"
        at += gap + struct.calcsize("<" + field)
    return struct.Struct(text)
