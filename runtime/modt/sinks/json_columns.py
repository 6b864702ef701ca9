"""Vectorised JSON numbers: the text that json writes, looked up in tables for whole columns.

A text is an array of uint32, each four ASCII characters, padded with NULs. Columns of texts side by side make rows;
`decode` removes the NULs. A column with a number that the tables lack is written one number at a time.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from modt.types import Float64, Int

Text = NDArray[np.uint32]

BASE = 10_000
"""One element holds four digits."""
LIMIT = BASE**2
"""Bound of the integers that two elements hold."""


@lru_cache
def encode(text: str) -> Text:
    """(w,) elements of an ASCII text."""
    return np.frombuffer(text.encode("ascii") + b"\0" * (-len(text) % 4), np.uint32)


def encode_table(texts: Sequence[str]) -> Text:
    """(n, w) elements of n texts, padded to the longest."""
    rows = [encode(text) for text in texts]
    out = np.zeros((len(rows), max(map(len, rows), default=0)), np.uint32)
    for row, padded in zip(rows, out, strict=True):
        padded[: len(row)] = row
    return out


def join_columns(n: int, *columns: str | Text) -> Text:
    """(n, w) rows of columns side by side: texts (n, v), or one text for all rows."""
    blocks = [encode(column)[None] if isinstance(column, str) else column for column in columns]
    out = np.empty((n, sum(block.shape[1] for block in blocks)), np.uint32)
    begin = 0
    for block in blocks:
        end = begin + block.shape[1]
        out[:, begin:end] = block
        begin = end
    return out


def decode(rows: Text) -> str:
    """Concatenated text of rows (n, w)."""
    return rows.tobytes().translate(None, b"\0").decode("ascii")


INTEGER = encode_table([f"{k}" for k in range(BASE)])[:, 0]
LAST_4_DIGITS = encode_table([f"{k:04}" for k in range(BASE)])[:, 0]
DECIMALS_1_TO_3 = encode_table([f".{k:03}" for k in range(1000)])[:, 0]
DECIMALS_1_TO_3_STRIPPED = encode_table([f".{k:03}".rstrip("0") if k else ".0" for k in range(1000)])[:, 0]
DECIMALS_4_TO_6_STRIPPED = encode_table([f"{k:03}".rstrip("0") for k in range(1000)])[:, 0]
EXPONENTIAL = encode_table([repr(k / 1e6) for k in range(100)])
"""Multiples of 1e-6 that repr writes with an exponent."""
MINUS = encode("-")[0]


def one_by_one(numbers: Int | Float64) -> Text:
    """(..., w) text of any numbers.

    Raises:
        ValueError: a number is not finite.
    """
    texts = [json.dumps(number, allow_nan=False) for number in numbers.ravel().tolist()]
    return encode_table(texts).reshape(*numbers.shape, -1)


def integers(numbers: Int) -> Text:
    """(..., w) text of integers from 0 on."""
    if (numbers >= LIMIT).any():
        return one_by_one(numbers)
    out = np.empty((*numbers.shape, 2), np.uint32)
    high, low = np.divmod(numbers, BASE)
    out[..., 0] = np.where(high > 0, INTEGER.take(high), 0)
    out[..., 1] = np.where(high > 0, LAST_4_DIGITS.take(low), INTEGER.take(low))
    return out


def rounded_to_3(numbers: Float64) -> Text:
    """(..., w) text of np.round(numbers, 3); ValueError if one is not finite."""
    if not (np.abs(numbers) < LIMIT - 1).all():
        return one_by_one(np.round(numbers, 3))
    out = np.empty((*numbers.shape, 4), np.uint32)
    units, decimals = np.divmod(np.rint(np.abs(numbers) * 1000).astype(np.int64), 1000)
    out[..., 0] = np.where(np.signbit(numbers), MINUS, 0)
    out[..., 1:3] = integers(units)
    out[..., 3] = DECIMALS_1_TO_3_STRIPPED.take(decimals)
    return out


def probabilities(numbers: Float64) -> Text:
    """(..., w) text of np.round(numbers, 6); ValueError if one is not finite."""
    if not (np.abs(numbers - 0.5) <= 0.5).all():
        return one_by_one(np.round(numbers, 6))
    out = np.empty((*numbers.shape, 3), np.uint32)
    millionths = np.rint(numbers * 1e6).astype(np.int64)
    thousandths, tail = np.divmod(millionths, 1000)
    units, decimals = np.divmod(thousandths, 1000)
    out[..., 0] = INTEGER.take(units)
    out[..., 1] = np.where(tail > 0, DECIMALS_1_TO_3.take(decimals), DECIMALS_1_TO_3_STRIPPED.take(decimals))
    out[..., 2] = DECIMALS_4_TO_6_STRIPPED.take(tail)
    small = (millionths > 0) & (millionths < len(EXPONENTIAL))
    out[small, 0] = 0
    out[small, 1:] = EXPONENTIAL[millionths[small]]
    return out
