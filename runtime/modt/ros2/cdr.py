"""Plain CDR (XCDR version 1), the encoding of ROS 2 messages."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from modt.types import Float64

HEADER_BYTES = 4
"""Encapsulation header: the byte order; alignment counts from behind it."""
MAX_TEXT_BYTES = 4096
"""Longest string that is read."""


class MessageError(ValueError):
    """Bytes that are no usable message, with the reason that they are counted by."""

    def __init__(self, reason: str, cause: str) -> None:
        super().__init__(cause)
        self.reason = reason


class CdrReader:
    """Reads the fields of a message in their order; never beyond its end.

    Raises:
        MessageError: `malformed`: another encapsulation, or lengths beyond the message.
    """

    def __init__(self, message: bytes) -> None:
        if len(message) < HEADER_BYTES or message[0] != 0 or message[1] > 1:
            raise MessageError("malformed", "it is not encoded in plain CDR")
        self._message, self._at = memoryview(message), HEADER_BYTES
        self.order = "<" if message[1] else ">"

    def number(self, code: str) -> int | float:
        """A number of the type that a format character of `struct` names."""
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

    def doubles(self, n: int) -> Float64:
        """(n,) 64-bit numbers."""
        return np.frombuffer(self._bytes(8 * n, 8), self.order + "f8").astype(np.float64)

    def stamp_s(self) -> float:
        """A builtin_interfaces/Time [s]."""
        seconds, nanoseconds = self.number("i"), self.count()
        return seconds + 1e-9 * nanoseconds

    def _bytes(self, size: int, alignment: int = 1) -> memoryview:
        begin = self._at + -(self._at - HEADER_BYTES) % alignment
        if begin + size > len(self._message):
            raise MessageError("malformed", f"{len(self._message)} bytes end within a field")
        self._at = begin + size
        return self._message[begin : self._at]


class CdrWriter:
    """Writes a message field by field, in little-endian byte order."""

    def __init__(self) -> None:
        self._message = bytearray(b"\0\1\0\0")

    def numbers(self, code: str, *values: float) -> None:
        """Numbers of the type that a format character of `struct` names."""
        self._align(struct.calcsize(code))
        self._message += struct.pack(f"<{len(values)}{code}", *values)

    def doubles(self, values: Sequence[float]) -> None:
        """64-bit numbers."""
        self.numbers("d", *values)

    def text(self, text: str) -> None:
        """A string."""
        self.octets(text.encode() + b"\0")

    def octets(self, octets: bytes) -> None:
        """A sequence of octets."""
        self.numbers("I", len(octets))
        self._message += octets

    def header(self, stamp_s: float, frame_id: str) -> None:
        """A std_msgs/Header."""
        seconds, nanoseconds = divmod(round(stamp_s * 1e9), 10**9)
        self.numbers("i", seconds)
        self.numbers("I", nanoseconds)
        self.text(frame_id)

    def message(self) -> bytes:
        """The whole message, padded to a multiple of four bytes as DDS requires it."""
        self._align(4)
        return bytes(self._message)

    def _align(self, size: int) -> None:
        self._message += bytes(-(len(self._message) - HEADER_BYTES) % size)
