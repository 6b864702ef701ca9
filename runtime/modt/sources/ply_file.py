"""PLY files: ascii, binary of either byte order; the element `vertex` holds the points."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.errors import ScanError
from modt.sources.point_table import MAX_POINTS, SKIPPED, numbers_of, points_of
from modt.types import Float32

TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
MAX_HEADER_BYTES = 65_536


@dataclass(slots=True)
class Element:
    """An element of a header: its name, rows, and its properties as (name, type)."""

    name: str
    n_rows: int
    properties: list[tuple[str, str]] = field(default_factory=list)


def read_ply(path: Path, raw: bytes) -> Float32:
    """(N, 4) points, as `points_of` has them.

    Raises:
        ScanError: no such file, truncated, or a header that cannot be.
    """
    end = raw[:MAX_HEADER_BYTES].find(b"end_header")
    start = raw.find(b"\n", end, end + 16) + 1
    if not raw.startswith(b"ply") or end < 0 or not start:
        raise ScanError(path, "no header of a PLY file", SKIPPED)
    try:
        encoding, elements = _header(raw[:end].decode("ascii", "replace"))
        before = list(takewhile(lambda element: element.name != "vertex", elements))
        vertex = elements[len(before)]
        if encoding == "ascii":  # a row is a line, so that lists after the numbers, and elements before, are skipped
            vertex.properties = list(takewhile(lambda p: not p[1].startswith("list"), vertex.properties))
            row, skipped_bytes = _row(vertex, encoding), 0
        else:
            row = _row(vertex, encoding)
            skipped_bytes = sum(e.n_rows * _row(e, encoding).itemsize for e in before)
    except (KeyError, ValueError, IndexError):
        raise ScanError(path, "its header cannot be read, or has lists before its points", SKIPPED) from None
    if not 0 <= vertex.n_rows <= MAX_POINTS or any(not 0 <= e.n_rows <= MAX_POINTS for e in before) or not row.names:
        raise ScanError(path, "its header promises what no scan has", SKIPPED)
    if encoding == "ascii":
        table = _text(path, raw[start:], sum(e.n_rows for e in before), vertex.n_rows, row)
    else:
        start += skipped_bytes
        if len(raw) - start < vertex.n_rows * row.itemsize:
            raise ScanError(path, f"truncated: {len(raw) - start} bytes for {vertex.n_rows} points", SKIPPED)
        table = np.frombuffer(raw, row, vertex.n_rows, start)
    return points_of({name.lower(): table[name] for name in row.names}, path)


def _header(text: str) -> tuple[str, list[Element]]:
    """Encoding and elements."""
    encoding, elements = "", list[Element]()
    for words in map(str.split, text.splitlines()):
        match words:
            case ["format", encoding, *_]:
                pass
            case ["element", name, count]:
                elements.append(Element(name, int(count)))
            case ["property", *kind, name]:
                elements[-1].properties.append((name, " ".join(kind)))
    return encoding, elements


def _row(element: Element, encoding: str) -> np.dtype[Any]:
    return np.dtype([(name, BYTE_ORDERS[encoding] + TYPES[kind]) for name, kind in element.properties])


def _text(path: Path, body: bytes, skipped: int, n_rows: int, row: np.dtype[Any]) -> NDArray[Any]:
    """Rows of the lines after some that are skipped; what follows the numbers of a row is left out."""
    names = row.names or ()
    lines = [line for line in body.splitlines() if line.strip()][skipped : skipped + n_rows]
    words = [word for line in lines for word in line.split(maxsplit=len(names))[: len(names)]]
    values, table = numbers_of(words, n_rows, len(names), path), np.empty(n_rows, row)
    with np.errstate(invalid="ignore", over="ignore"):
        for i, name in enumerate(names):
            table[name] = values[:, i]
    return table
