"""IPv4 and IPv6 packets, and the fragments in which they may come."""

from __future__ import annotations

import socket

MAX_PENDING = 64
"""Greatest number of incomplete packets; beyond it the oldest one is dropped."""
MAX_PACKET_BYTES = 65_535
MORE = 0x2000
"""Flag of a fragment of IPv4 that is not the last one; the other bits of the field are its offset in 8 bytes."""
OFFSET = 0x1FFF
IPV4_BYTES = 20
"""Size of a header of IPv4 without options."""
IPV6_BYTES = 40
"""Size of a header of IPv6 without extensions."""
FRAGMENT = 44
EXTENSIONS = (0, 43, FRAGMENT, 60)
"""Extension headers of IPv6: hop by hop, routing, fragment, destination."""

Packet = tuple[str, int, bytes]
"""Source, protocol and payload of a whole IP packet."""


class Fragments:
    """Joins the fragments of IP packets, with bounded memory."""

    def __init__(self) -> None:
        self._pending: dict[bytes, dict[int, tuple[bytes, bool]]] = {}

    def whole(self, raw: bytes) -> Packet | None:
        """Packet that these bytes complete; None while a part is missing, or if they are no IP packet."""
        version = raw[0] >> 4 if raw else 0
        if version == 6 and len(raw) >= IPV6_BYTES:
            return self._whole_of_ipv6(raw)
        if version == 4 and len(raw) >= IPV4_BYTES:
            return self._whole_of_ipv4(raw)
        return None

    def _whole_of_ipv4(self, raw: bytes) -> Packet | None:
        header_bytes = 4 * (raw[0] & 15)
        end = int.from_bytes(raw[2:4], "big") or None  # a network card that cuts packets writes 0
        flags = int.from_bytes(raw[6:8], "big")
        key = raw[12:20] + raw[4:6] + raw[9:10]  # source and destination, identification, protocol
        payload = self._joined(key, 8 * (flags & OFFSET), raw[header_bytes:end], bool(flags & MORE))
        if payload is None:
            return None
        return socket.inet_ntoa(raw[12:16]), raw[9], payload

    def _whole_of_ipv6(self, raw: bytes) -> Packet | None:
        length = int.from_bytes(raw[4:6], "big")
        kind = raw[6]
        payload: bytes | None = raw[IPV6_BYTES:][: length or None]
        while payload and kind in EXTENSIONS and len(payload) >= 8:
            header = payload[:8]
            size = 8 if kind == FRAGMENT else 8 * (header[1] + 1)
            payload = payload[size:]
            if kind == FRAGMENT:
                offset = int.from_bytes(header[2:4], "big")
                key = raw[8:IPV6_BYTES] + header[4:]  # source and destination, identification
                payload = self._joined(key, offset & ~7, payload, bool(offset & 1))
            kind = header[0]
        return None if payload is None else (socket.inet_ntop(socket.AF_INET6, raw[8:24]), kind, payload)

    def _joined(self, key: bytes, offset: int, payload: bytes, more: bool) -> bytes | None:
        """Payload that a fragment completes, None while a part is missing."""
        if not offset and not more:
            return payload
        parts = self._pending.setdefault(key, {})
        parts[offset] = (payload, more)
        joined = b""
        while len(joined) in parts and len(joined) <= MAX_PACKET_BYTES:
            part, more = parts[len(joined)]
            joined += part
            if not more:
                del self._pending[key]
                return joined
            if not part:
                break
        if len(self._pending) > MAX_PENDING:
            del self._pending[next(iter(self._pending))]
        return None
