"""The file of a model: its bytes are those of its card, and they alone are what runs.

An ONNX model may name other files to load its numbers from, and may hold loops and functions that stand for more work
than its size tells. Such a model is refused before ONNX Runtime sees it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

from modt.errors import MisuseError

MAX_BYTES = 64 << 20
REMEDY = "use a model of tools/train/export_pointnet.py"
_MODEL, _GRAPH, _NODE, _ATTRIBUTE, _TENSOR, _SPARSE = range(6)
_PARTS = {
    _MODEL: {7: _GRAPH},
    _GRAPH: {1: _NODE, 5: _TENSOR, 15: _SPARSE},
    _NODE: {5: _ATTRIBUTE},
    _ATTRIBUTE: {5: _TENSOR, 10: _TENSOR, 22: _SPARSE, 23: _SPARSE},
    _SPARSE: {1: _TENSOR, 2: _TENSOR},
    _TENSOR: {},
}
"""Fields of onnx.proto3 that hold messages, by the message that they are in."""
_REFUSED = {
    _MODEL: {20: "training", 25: "functions"},
    _ATTRIBUTE: {6: "a graph within a node", 11: "a graph within a node"},
    _TENSOR: {13: "numbers in another file"},
}
_VARINT, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5


def read_model(path: Path) -> tuple[bytes, str]:
    """Bytes of a model and their SHA-256, equal to that in its card (the file beside it that ends in .md), if any.

    Raises:
        MisuseError: unreadable, too large, not the model of its card, or not a plain ONNX model.
    """
    card = path.with_suffix(".md")
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
        named = re.search(r"sha256\W+([0-9a-f]{64})", card.read_text(encoding="utf-8")) if card.is_file() else None
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "make model and card readable") from None
    if len(raw) > MAX_BYTES:
        raise MisuseError(path, f"larger than {MAX_BYTES >> 20} MiB", REMEDY)
    sha256 = hashlib.sha256(raw).hexdigest()
    if named and named[1] != sha256:
        raise MisuseError(path, f"is not the model of {card.name} (sha256 {sha256})", "restore the model or its card")
    try:
        flaw = next(_flaws(memoryview(raw)), None)
    except (IndexError, ValueError):
        flaw = "no protocol buffer"
    if flaw:
        raise MisuseError(path, f"not an ONNX model that is run here ({flaw})", REMEDY)
    return raw, sha256


def _flaws(raw: memoryview) -> Iterator[str]:
    """What a model holds that is refused."""
    waiting = [(_MODEL, raw)]
    while waiting:
        kind, message = waiting.pop()
        for number, value in _fields(message):
            if number in _REFUSED.get(kind, {}):
                yield _REFUSED[kind][number]
            inner = _PARTS[kind].get(number)
            if inner is not None and value is not None:
                waiting.append((inner, value))


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview | None]]:
    """Numbers of the fields of a message, and the bytes of those that have a length.

    Raises:
        IndexError, ValueError: it is no message.
    """
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        number, kind = key >> 3, key & 7
        if key >> 32:  # other readers would drop the bits beyond
            raise ValueError("no such field")
        value = None
        if kind == _VARINT:
            _, at = _varint(message, at)
        elif kind == _BYTES:
            length, at = _varint(message, at)
            value = message[at : at + length]
            at += length
        elif kind in (_FOUR_BYTES, _EIGHT_BYTES):
            at += 4 if kind == _FOUR_BYTES else 8
        else:
            raise ValueError("no such kind of field")
        if at > len(message):
            raise ValueError("a field beyond the end")
        yield number, value


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number at a place, and the place after it."""
    out = 0
    for shift in range(0, 70, 7):
        byte = message[at]
        at += 1
        out |= (byte & 0x7F) << shift
        if byte < 0x80:
            return out, at
    raise ValueError("a number without an end")
