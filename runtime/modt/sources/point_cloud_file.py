"""Points of PCD files (ascii, binary, binary_compressed) and PLY files (ascii, binary of either byte order)."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.geometry import rotation_of, se3, transform
from modt.ros2.point_cloud2 import reflectance_name
from modt.types import UNRECORDED, Float32, Float64

Columns = Mapping[str, NDArray[Any]]


class CloudError(Exception):
    """Bytes that are no file of points, and the cause."""


MAX_POINTS = 10_000_000
"""Greatest number of points in a sweep; a header that promises more is refused."""
MAX_COUNT = 1024
"""Greatest number of values of a PCD field in one point."""
MAX_HEADER_BYTES = 65_536
BYTE_MAX = 255
WORD_MAX = 65_535
PCD_TYPES = {kind: f"<{kind.lower()}" for kind in ("F4", "F8", *(sign + size for sign in "UI" for size in "1248"))}
PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
PLY_TYPES |= {"float": "f4", "double": "f8"}
PLY_TYPES |= {np.dtype(kind).name: kind for kind in PLY_TYPES.values()}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}


def viewpoint_of(raw: bytes) -> Float64 | None:
    """(4, 4) pose of the sensor by the line VIEWPOINT of a PCD file; None without one, or if it is the identity."""
    line = re.search(rb"^VIEWPOINT[ \t]+([^\r\n]+)", raw[:MAX_HEADER_BYTES], re.MULTILINE)
    try:
        x, y, z, qw, qx, qy, qz = map(float, line[1].split() if line else [])
    except ValueError:
        return None
    if not 0.9 < math.hypot(qw, qx, qy, qz) < 1.1 or not math.isfinite(x + y + z):
        return None
    T = se3(rotation_of(np.array([qx, qy, qz, qw])), np.array([x, y, z]))
    return None if np.allclose(T, np.eye(4), atol=1e-6) else T


def read_pcd(raw: bytes, T_sensor_file: Float64 | None = None) -> Float32:
    """(N, 4) points of a PCD file, as `points_of` scales them and places them in the sensor's frame.

    Raises:
        CloudError: the file is no PCD file, is truncated, or its header promises impossible data.
    """
    encoding, names, row, n_points, start = _pcd_header(raw)
    if encoding == "ascii":
        columns = _columns(names, _from_text(raw[start:].splitlines(), n_points, row))
    elif encoding == "binary":
        columns = _columns(names, _from_bytes(raw, start, n_points, row))
    elif encoding == "binary_compressed":
        columns = _from_compressed(raw[start:], names, n_points, row)
    else:
        raise CloudError(f"DATA {encoding!r} is unknown")
    return points_of(columns, T_sensor_file)


def read_ply(raw: bytes) -> Float32:
    """(N, 4) points of the element `vertex` of a PLY file, as `points_of` scales them.

    Raises:
        CloudError: the file is no PLY file, is truncated, or its header promises impossible data.
    """
    end = raw[:MAX_HEADER_BYTES].find(b"end_header")
    start = raw.find(b"\n", end, end + 16) + 1
    if not raw.startswith(b"ply") or end < 0 or not start:
        raise CloudError("no header of a PLY file")
    try:
        encoding, elements = _ply_header(raw[:end].decode("ascii", "replace"))
        before = list(takewhile(lambda element: element[0] != "vertex", elements))
        _, n_points, properties = elements[len(before)]
        if encoding == "ascii":  # each row is a line, so lists behind the numbers and other elements can be skipped
            properties = list(takewhile(lambda p: not p[1].startswith("list"), properties))
        else:
            start += sum(n_rows * _ply_row(kinds, encoding).itemsize for _, n_rows, kinds in before)
        row = _ply_row(properties, encoding)
    except (KeyError, ValueError, IndexError):
        raise CloudError("its header cannot be read, or has lists before its points") from None
    counts = [n_points, *(n_rows for _, n_rows, _ in before)]
    if not all(0 <= count <= MAX_POINTS for count in counts) or not row.names:
        raise CloudError("its header promises what no scan has")
    if encoding == "ascii":
        lines = [line for line in raw[start:].splitlines() if line.strip()]
        table = _from_text(lines[sum(counts[1:]) :], n_points, row)
    else:
        table = _from_bytes(raw, start, n_points, row)
    return points_of(_columns([name.lower() for name, _ in properties], table))


def points_of(columns: Columns, T_sensor_file: Float64 | None = None) -> Float32:
    """(N, 4) points of named columns, placed by a (4, 4) transform while they have their full precision.

    Reflectance is UNRECORDED without a column and NaN where its scale is unknown. Whole numbers are divided by 255,
    or by 65535 where they exceed 255; `sanitised` scales the others.

    Raises:
        CloudError: x, y or z is missing.
    """
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        raise CloudError(f"no column {', '.join(missing)}")
    points = np.empty((len(columns["x"]), 4), np.float32)
    with np.errstate(over="ignore"):  # doubles beyond float32 become infinite, which counts as no return
        if T_sensor_file is not None:
            xyz = np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64)
            points[:, :3] = transform(T_sensor_file, xyz)
        else:
            for i, axis in enumerate("xyz"):
                points[:, i] = columns[axis]
    name = reflectance_name(columns)
    points[:, 3] = UNRECORDED if name is None else _reflectance(columns[name])
    return points


def _reflectance(values: NDArray[Any]) -> NDArray[Any]:
    greatest = values.max(initial=0)
    if np.issubdtype(values.dtype, np.integer):
        return np.clip(values / (BYTE_MAX if greatest <= BYTE_MAX else WORD_MAX), 0.0, 1.0)
    return np.full(len(values), np.nan) if greatest > BYTE_MAX else values


def _pcd_header(raw: bytes) -> tuple[str, list[str], np.dtype[Any], int, int]:
    """Encoding, names of the columns, type of a point, number of points, and offset of the data."""
    data_at = raw[:MAX_HEADER_BYTES].find(b"\nDATA ")
    end = raw.find(b"\n", data_at + 1, MAX_HEADER_BYTES)
    if data_at < 0 or end < 0:
        raise CloudError("no header of a PCD file")
    words = (line.split() for line in raw[:end].decode("ascii", "replace").splitlines())
    lines = {line[0].upper(): line[1:] for line in words if line and not line[0].startswith("#")}
    try:
        names = [name.lower() for name in lines["FIELDS"]]
        kinds = [PCD_TYPES[t + s] for t, s in zip(lines["TYPE"], lines["SIZE"], strict=True)]
        counts = list(map(int, lines.get("COUNT", ["1"] * len(names))))
        n_points = int(lines["POINTS"][0]) if "POINTS" in lines else int(lines["WIDTH"][0]) * int(lines["HEIGHT"][0])
        encoding = lines["DATA"][0]
    except (KeyError, ValueError, IndexError):
        raise CloudError("its header lacks a line, or one is broken") from None
    fields = [field for field in zip(names, kinds, counts, strict=False) if field[2]]  # others hold no bytes
    odd = [f"{name} of COUNT {count}" for name, _, count in fields if not 0 < count <= MAX_COUNT]
    odd += [] if 0 <= n_points <= MAX_POINTS else [f"{n_points} points"]
    odd += [] if fields and len(names) == len(kinds) == len(counts) else ["lines of unlike length"]
    if odd:
        raise CloudError(f"its header promises what no scan has ({odd[0]})")
    row = np.dtype([(str(i), kind, (count,)) for i, (_, kind, count) in enumerate(fields)])
    return encoding, [name for name, _, _ in fields], row, n_points, end + 1


def _ply_header(text: str) -> tuple[str, list[tuple[str, int, list[tuple[str, str]]]]]:
    """Encoding, and name, number of rows and properties (name, type) of each element."""
    encoding = ""
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []
    for words in map(str.split, text.splitlines()):
        match words:
            case ["format", encoding, *_]:
                pass
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", *kind, name]:
                elements[-1][2].append((name, " ".join(kind)))
    return encoding, elements


def _ply_row(properties: Sequence[tuple[str, str]], encoding: str) -> np.dtype[Any]:
    kinds = (BYTE_ORDERS[encoding] + PLY_TYPES[kind] for _, kind in properties)
    return np.dtype([(str(i), kind, (1,)) for i, kind in enumerate(kinds)])


def _columns(names: Sequence[str], table: NDArray[Any]) -> Columns:
    """First value of each field by name; the fields of the table are numbered, as names may repeat."""
    return {name: table[str(i)][:, 0] for i, name in enumerate(names)}


def _from_bytes(raw: bytes, start: int, n_points: int, row: np.dtype[Any]) -> NDArray[Any]:
    if len(raw) - start < n_points * row.itemsize:
        raise CloudError(f"truncated: {len(raw) - start} bytes for {n_points} points")
    return np.frombuffer(raw, row, n_points, start)


def _from_text(lines: Sequence[bytes], n_points: int, row: np.dtype[Any]) -> NDArray[Any]:
    """Points of lines of numbers; further words of a line are skipped."""
    counts = [row[name].shape[0] for name in row.names or ()]
    width = sum(counts)
    words = [word for line in lines[:n_points] for word in line.split(maxsplit=width)[:width]]
    if len(words) < n_points * width:
        raise CloudError(f"truncated: {len(words)} numbers for {n_points} points")
    try:
        values = np.array(words, np.float64).reshape(-1, width)
    except ValueError:
        raise CloudError("its text holds what is no number") from None
    table = np.empty(n_points, row)
    at = 0
    with np.errstate(invalid="ignore", over="ignore"):
        for i, count in enumerate(counts):
            table[str(i)] = values[:, at : at + count]
            at += count
    return table


def _from_compressed(body: bytes, names: Sequence[str], n_points: int, row: np.dtype[Any]) -> dict[str, NDArray[Any]]:
    """Columns of compressed data, which hold all values of a field in a row."""
    size, length = struct.unpack_from("<II", body) if len(body) >= 8 else (0, -1)
    if length != n_points * row.itemsize or len(body) < 8 + size:
        raise CloudError("truncated, or of another size than its header says")
    data = decompress(body[8 : 8 + size], length)
    if data is None:
        raise CloudError("its compressed data are broken")
    columns = {}
    at = 0
    for i, name in enumerate(names):
        columns[name] = np.frombuffer(data, row[i], n_points, at)[:, 0]
        at += n_points * row[i].itemsize
    return columns


MAX_LITERAL = 32
"""Control bytes of LZF below this announce literal bytes; others announce a repetition of earlier ones."""
LONG_REPETITION = 7
"""Size in the control byte of a repetition that is continued in the next byte."""


def decompress(data: bytes, length: int) -> bytes | None:
    """The `length` bytes of LZF data; None if the data are broken or hold more or less."""
    out = bytearray()
    at = 0
    end = len(data)
    while at < end and len(out) <= length:
        control = data[at]
        at += 1
        if control < MAX_LITERAL:
            out += data[at : at + control + 1]
            at += control + 1
        else:
            size = control >> 5
            if at + 1 + (size == LONG_REPETITION) > end:
                return None
            if size == LONG_REPETITION:
                size += data[at]
                at += 1
            size += 2
            distance = ((control & 31) << 8 | data[at]) + 1
            at += 1
            start = len(out) - distance
            if start < 0:
                return None
            piece = out[start : start + size]
            out += piece if size <= distance else (piece * (size // distance + 1))[:size]
    return bytes(out) if len(out) == length and at == end else None
