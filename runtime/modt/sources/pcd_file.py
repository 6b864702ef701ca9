"""PCD files of the Point Cloud Library: ascii, binary, binary_compressed."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.errors import ScanError
from modt.sources.point_table import MAX_POINTS, SKIPPED, numbers_of, points_of
from modt.types import Float32

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


TYPES = {"F4": "<f4", "F8": "<f8", "U1": "u1", "U2": "<u2", "U4": "<u4", "U8": "<u8"}
TYPES |= {"I1": "i1", "I2": "<i2", "I4": "<i4", "I8": "<i8"}
MAX_HEADER_BYTES = 65_536
MAX_COUNT = 1024


@dataclass(frozen=True, slots=True)
class Header:
    """What a file says of its data.

    Attributes:
        names, kinds, counts: of its fields, NumPy's name of the type, numbers a point.
        n_points, encoding: of the data.
    """

    names: tuple[str, ...]
    kinds: tuple[np.dtype[Any], ...]
    counts: tuple[int, ...]
    n_points: int
    encoding: str

    @property
    def row_bytes(self) -> int:
        """Bytes of a point in binary data."""
        return sum(kind.itemsize * count for kind, count in zip(self.kinds, self.counts, strict=True))


def read_pcd(path: Path, raw: bytes) -> Float32:
    """(N, 4) points, as `points_of` has them.

    Raises:
        ScanError: no such file, truncated, or a header that cannot be.
    """
    header, start = _header(path, raw)
    columns = COLUMNS.get(header.encoding)
    if columns is None:
        raise ScanError(path, f"DATA {header.encoding!r} is unknown", SKIPPED)
    return points_of(columns(path, header, raw[start:]), path)


def _header(path: Path, raw: bytes) -> tuple[Header, int]:
    found = raw[:MAX_HEADER_BYTES].find(b"\nDATA ")
    end = raw.find(b"\n", found + 1, MAX_HEADER_BYTES)
    if found < 0 or end < 0:
        raise ScanError(path, "no header of a PCD file", SKIPPED)
    lines = (line.split() for line in raw[:end].decode("ascii", "replace").splitlines())
    said = {line[0].upper(): line[1:] for line in lines if line and not line[0].startswith("#")}
    try:
        names = tuple(name.lower() for name in said["FIELDS"])
        kinds = tuple(np.dtype(TYPES[t + s]) for t, s in zip(said["TYPE"], said["SIZE"], strict=True))
        counts = tuple(map(int, said.get("COUNT", ["1"] * len(names))))
        n_points = int(said["POINTS"][0]) if "POINTS" in said else int(said["WIDTH"][0]) * int(said["HEIGHT"][0])
        encoding = said["DATA"][0]
    except (KeyError, ValueError, IndexError):
        raise ScanError(path, "its header lacks a line, or one is broken", SKIPPED) from None
    fields = [field for field in zip(names, kinds, counts, strict=False) if field[2]]  # others hold no bytes
    odd = [f"{name} of COUNT {count}" for name, _, count in fields if not 0 < count <= MAX_COUNT]
    odd += [] if 0 <= n_points <= MAX_POINTS else [f"{n_points} points"]
    odd += [] if fields and len(names) == len(kinds) == len(counts) else ["lines of unlike length"]
    if odd:
        raise ScanError(path, f"its header promises what no scan has ({odd[0]})", SKIPPED)
    names, kinds, counts = zip(*fields, strict=True)
    return Header(names, kinds, counts, n_points, encoding), end + 1


def _ascii(path: Path, header: Header, body: bytes) -> Mapping[str, NDArray[Any]]:
    width = sum(header.counts)
    table = numbers_of(body.split(), header.n_points, width, path)
    starts = np.cumsum((0, *header.counts))
    integral = [np.issubdtype(kind, np.integer) for kind in header.kinds]
    columns = zip(header.names, starts, integral, strict=False)
    with np.errstate(invalid="ignore"):
        return {name: table[:, at].astype(np.int64) if whole else table[:, at] for name, at, whole in columns}


def _binary(path: Path, header: Header, body: bytes) -> Mapping[str, NDArray[Any]]:
    if len(body) < header.n_points * header.row_bytes:
        raise ScanError(path, f"truncated: {len(body)} bytes for {header.n_points} points", SKIPPED)
    offsets = np.cumsum((0, *(k.itemsize * c for k, c in zip(header.kinds, header.counts, strict=True))))
    row = np.dtype(
        {
            "names": [str(i) for i in range(len(header.names))],  # those of the file may occur twice
            "formats": header.kinds,
            "offsets": offsets[:-1].tolist(),
            "itemsize": header.row_bytes,
        }
    )
    table = np.frombuffer(body, row, header.n_points)
    return {name: table[str(i)] for i, name in enumerate(header.names)}


def _compressed(path: Path, header: Header, body: bytes) -> Mapping[str, NDArray[Any]]:
    """All numbers of a field follow one another."""
    size, length = struct.unpack_from("<II", body) if len(body) >= 8 else (0, -1)
    if length != header.n_points * header.row_bytes or len(body) < 8 + size:
        raise ScanError(path, "truncated, or of another size than its header says", SKIPPED)
    data = decompress(body[8 : 8 + size], length)
    if data is None:
        raise ScanError(path, "its compressed data are broken", SKIPPED)
    columns, at = {}, 0
    for name, kind, count in zip(header.names, header.kinds, header.counts, strict=True):
        columns[name] = np.frombuffer(data, kind, header.n_points * count, at)[::count]
        at += header.n_points * count * kind.itemsize
    return columns


COLUMNS = {"ascii": _ascii, "binary": _binary, "binary_compressed": _compressed}
