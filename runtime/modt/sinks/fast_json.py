"""Numbers as text, many at once, by tables: what repr and json write, without asking either for every number.

Text is held as words of four characters, one uint32 each, filled up with NULs. Columns of words side by side are
lines of text; `text` drops the NULs.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from modt.types import Float64, Int

Words = NDArray[np.uint32]

BASE = 10_000
"""A word holds four digits."""
LIMIT = BASE**2
"""Whole numbers are written in two words, so they are less than this."""


@lru_cache
def words(text: str) -> Words:
    """(w,) words of an ASCII text."""
    return np.frombuffer(text.encode("ascii") + b"\0" * (-len(text) % 4), np.uint32)


def table(texts: list[str]) -> Words:
    """(n, w) words of n texts, as many as the longest needs."""
    rows = [words(text) for text in texts]
    out = np.zeros((len(rows), max(map(len, rows))), np.uint32)
    for row, filled in zip(rows, out, strict=True):
        filled[: len(row)] = row
    return out


def beside(n: int, *columns: str | Words) -> Words:
    """(n, w) lines of columns side by side: words (n, v) of their own, or a text that is the same in all lines."""
    blocks = [words(column)[None] if isinstance(column, str) else column for column in columns]
    out = np.empty((n, sum(block.shape[1] for block in blocks)), np.uint32)
    end = 0
    for block in blocks:
        begin, end = end, end + block.shape[1]
        out[:, begin:end] = block
    return out


def text(lines: Words) -> str:
    """(n, w) lines, one after the other."""
    return lines.tobytes().translate(None, b"\0").decode("ascii")


PLAIN = table([f"{k}" for k in range(BASE)])[:, 0]
FILLED = table([f"{k:04}" for k in range(BASE)])[:, 0]
POINT = table([f".{k:03}" for k in range(1000)])[:, 0]
POINT_SHORT = table([f".{k:03}".rstrip("0") if k else ".0" for k in range(1000)])[:, 0]
TAIL_SHORT = table([f"{k:03}".rstrip("0") for k in range(1000)])[:, 0]
MILLIONTHS = table([repr(k / 1e6) for k in range(100)])
"""Written with an exponent, up to this many."""
MINUS = words("-")[0]


def whole(numbers: Int) -> Words:
    """(n, 2) words of whole numbers (n,) from 0 to less than LIMIT."""
    out = np.empty((*numbers.shape, 2), np.uint32)
    high, low = np.divmod(numbers, BASE)
    out[..., 0] = np.where(high > 0, PLAIN.take(high), 0)
    out[..., 1] = np.where(high > 0, FILLED.take(low), PLAIN.take(low))
    return out


def thousandths(numbers: Float64) -> Words:
    """(..., 4) words of np.round(numbers, 3), whose amount is less than LIMIT."""
    out = np.empty((*numbers.shape, 4), np.uint32)
    units, rest = np.divmod(np.rint(np.abs(numbers) * 1000).astype(np.int64), 1000)
    out[..., 0] = np.where(np.signbit(numbers), MINUS, 0)
    out[..., 1:3] = whole(units)
    out[..., 3] = POINT_SHORT.take(rest)
    return out


def probabilities(numbers: Float64) -> Words:
    """(..., 3) words of np.round(numbers, 6), which lie between 0 and 1."""
    out = np.empty((*numbers.shape, 3), np.uint32)
    millionths = np.rint(numbers * 1e6).astype(np.int64)
    thousands, tail = np.divmod(millionths, 1000)
    units, rest = np.divmod(thousands, 1000)
    out[..., 0] = PLAIN.take(units)
    out[..., 1] = np.where(tail > 0, POINT.take(rest), POINT_SHORT.take(rest))
    out[..., 2] = TAIL_SHORT.take(tail)
    tiny = (millionths > 0) & (millionths < len(MILLIONTHS))
    out[tiny, 0], out[tiny, 1:] = 0, MILLIONTHS[millionths[tiny]]
    return out
