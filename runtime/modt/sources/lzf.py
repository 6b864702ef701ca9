"""LZF, the compression of PCD files."""

from __future__ import annotations

MAX_LITERAL = 32


def decompress(data: bytes, length: int) -> bytes | None:
    """The `length` bytes that were compressed; None if the data are broken or hold more or less."""
    out, at, end = bytearray(), 0, len(data)
    while at < end:
        control = data[at]
        at += 1
        if control < MAX_LITERAL:
            out += data[at : at + control + 1]
            at += control + 1
        else:
            size = control >> 5
            if at + 1 + (size == 7) > end:
                return None
            if size == 7:
                size += data[at]
                at += 1
            start = len(out) - ((control & 31) << 8 | data[at]) - 1
            at, size = at + 1, size + 2
            if start < 0:
                return None
            distance = len(out) - start
            piece = out[start : start + size]
            out += piece if size <= distance else (piece * (size // distance + 1))[:size]
        if len(out) > length:
            return None
    return bytes(out) if len(out) == length and at == end else None
