"""Messages of type foxglove.PointCloud, in JSON and in Protocol Buffers."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from modt.ros2.cdr import MessageError
from modt.ros2.point_cloud2 import MAX_FIELDS, PointCloud, Table, cloud_of

TYPE = "foxglove.PointCloud"
NUMBERS = {1: "u1", 2: "i1", 3: "u2", 4: "i2", 5: "u4", 6: "i4", 7: "f4", 8: "f8"}
"""NumPy's name of each numeric type of a PackedElementField."""
VARINT = 0
FIXED_64 = 1
TEXT = 2
FIXED_32 = 5
# Numbers of the fields of a PointCloud
STAMP = 1
FRAME = 2
STRIDE = 4
FIELD = 5
DATA = 6
# Numbers of the fields of a PackedElementField
NAME = 1
OFFSET = 2
KIND = 3


def _of_json(message: bytes) -> PointCloud:
    """The sweep in a message in JSON.

    Raises:
        MessageError: `malformed`, `empty` or `fields`.
    """
    try:
        found = json.loads(message)
        time = found["timestamp"]
        fields = [(str(f["name"]), int(f["offset"]), int(f["type"])) for f in found["fields"]]
        data = base64.b64decode(found["data"])
        stamp_s = int(time["sec"]) + 1e-9 * int(time["nsec"])
        frame = str(found["frame_id"])
        stride = int(found["point_stride"])
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise MessageError("malformed", f"no foxglove.PointCloud in JSON ({error})") from None
    return _cloud(stamp_s, frame, stride, fields, data)


def _of_protobuf(message: bytes) -> PointCloud:
    """The sweep in a message in Protocol Buffers.

    Raises:
        MessageError: `malformed`, `empty` or `fields`.
    """
    values: dict[int, Any] = {}
    fields = []
    for number, value in _values(message):
        if number == FIELD:
            field = dict(_values(value))
            name = bytes(field.get(NAME, b"")).decode("utf-8", "replace")
            fields.append((name, int(field.get(OFFSET, 0)), int(field.get(KIND, 0))))
        else:
            values[number] = value
    try:
        time = dict(_values(values.get(STAMP, b"")))
        frame = bytes(values.get(FRAME, b"")).decode("utf-8", "replace")
        stamp_s = int(time.get(1, 0)) + 1e-9 * int(time.get(2, 0))
        return _cloud(stamp_s, frame, int(values.get(STRIDE, 0)), fields, bytes(values.get(DATA, b"")))
    except (TypeError, ValueError):
        raise MessageError("malformed", "no foxglove.PointCloud in Protocol Buffers") from None


READERS: dict[str, Callable[[bytes], PointCloud]] = {"json": _of_json, "protobuf": _of_protobuf}
"""Readers of a message by the encoding of its channel."""


def _values(message: bytes) -> Iterator[tuple[int, Any]]:
    """Number and value of each field of a message: a number, or bytes."""
    if not isinstance(message, bytes):
        raise MessageError("malformed", "a number in the place of a message")
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        value: int | bytes
        if kind == VARINT:
            value, at = _varint(message, at)
        elif kind in (FIXED_32, FIXED_64, TEXT):
            size = {FIXED_32: 4, FIXED_64: 8}.get(kind, 0)
            if kind == TEXT:
                size, at = _varint(message, at)
            if at + size > len(message):
                raise MessageError("malformed", f"{len(message)} bytes end within a field")
            part = message[at : at + size]
            value = part if kind == TEXT else int.from_bytes(part, "little")
            at += size
        else:
            raise MessageError("malformed", "no Protocol Buffers")
        yield key >> 3, value


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """A number of up to ten bytes, and the offset behind it."""
    value = 0
    for k, byte in enumerate(message[at : at + 10]):
        value |= (byte & 127) << 7 * k
        if byte < 128:
            return value, at + k + 1
    raise MessageError("malformed", f"{len(message)} bytes end within a number")


def _cloud(stamp_s: float, frame: str, stride: int, fields: list[tuple[str, int, int]], data: bytes) -> PointCloud:
    if not data:
        raise MessageError("empty", "no points")
    within = [
        (name.lower(), "<" + NUMBERS[kind], offset)
        for name, offset, kind in fields[:MAX_FIELDS]
        if kind in NUMBERS and 0 <= offset <= stride - np.dtype(NUMBERS[kind]).itemsize
    ]
    names = dict.fromkeys(name for name, _, _ in within)
    if len(names) < len(within) or not 0 < stride <= len(data):
        raise MessageError("malformed", "fields of one name, or a stride that fits no point")
    formats = [kind for _, kind, _ in within]
    offsets = [at for _, _, at in within]
    row = np.dtype({"names": [*names], "formats": formats, "offsets": offsets, "itemsize": stride})
    rows = np.frombuffer(data, row, len(data) // stride).reshape(1, -1)
    return cloud_of(stamp_s, frame, Table(rows))
