"""IPv4 packets from their fragments."""

from __future__ import annotations

import struct
from dataclasses import dataclass

MAX_PENDING = 64
"""Packets of which fragments are awaited; then the oldest is given up."""
MORE, OFFSET = 0x2000, 0x1FFF
MAX_PACKET_BYTES = 65_535


@dataclass(frozen=True, slots=True)
class Packet:
    """A whole IPv4 packet without its header."""

    source: str
    protocol: int
    payload: bytes


class Fragments:
    """Puts fragments together; bounded in what it keeps."""

    def __init__(self) -> None:
        self._pending: dict[bytes, dict[int, tuple[bytes, bool]]] = {}

    def whole(self, raw: bytes) -> Packet | None:
        """The packet that these bytes of an IPv4 packet complete, None while it lacks a part or is none."""
        if len(raw) < 20 or raw[0] >> 4 != 4:
            return None
        start, length = 4 * (raw[0] & 15), int.from_bytes(raw[2:4], "big")
        payload = raw[start : length or None]
        flags = struct.unpack_from(">H", raw, 6)[0]
        offset, more = 8 * (flags & OFFSET), bool(flags & MORE)
        if offset or more:
            key = raw[12:20] + raw[4:6] + raw[9:10]
            joined = self._join(key, offset, payload, more)
            if joined is None:
                return None
            payload = joined
        return Packet(".".join(map(str, raw[12:16])), raw[9], payload)

    def _join(self, key: bytes, offset: int, payload: bytes, more: bool) -> bytes | None:
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
