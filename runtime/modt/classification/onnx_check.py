"""Refusal of models that are more than a plain network, before ONNX Runtime sees them.

An ONNX model may name other files to load its numbers from, and may hold loops, functions and text that stand for
more work and memory than its size tells. It is a protocol buffer: nested messages of numbered fields
(https://protobuf.dev/programming-guides/encoding, numbers by onnx.proto3).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

_MODEL, _GRAPH, _NODE, _ATTRIBUTE, _TENSOR, _SPARSE_TENSOR = range(6)
_INNER_MESSAGES = {
    _MODEL: {7: _GRAPH},
    _GRAPH: {1: _NODE, 5: _TENSOR, 15: _SPARSE_TENSOR},
    _NODE: {5: _ATTRIBUTE},
    _ATTRIBUTE: {5: _TENSOR, 10: _TENSOR, 22: _SPARSE_TENSOR, 23: _SPARSE_TENSOR},
    _SPARSE_TENSOR: {1: _TENSOR, 2: _TENSOR},
    _TENSOR: {},
}
"""Fields that hold messages, by the message that they are in."""
_REFUSED = {
    _MODEL: {20: "training", 25: "functions"},
    _ATTRIBUTE: {6: "a graph within a node", 9: "text", 11: "a graph within a node"},
    _TENSOR: {6: "text", 13: "numbers in another file"},
}
"""Fields that are refused, by the message that they are in."""
_DIMENSIONS = {(_TENSOR, 1), (_SPARSE_TENSOR, 3)}
"""Fields with the dimensions of a tensor."""
_TENSOR_TYPE = 2
_ATTRIBUTE_NAME = 1
_ATTRIBUTE_INTEGER = 3
_TEXT = 8
"""Type of tensors of text, of which few bytes stand for much memory."""
_VARINT, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5
"""Wire types of a field."""


def find_flaw(content: bytes) -> str | None:
    """The first part of a model that is refused, None if it is a plain network."""
    try:
        return next(_flaws(memoryview(content)), None)
    except (IndexError, ValueError):
        return "no protocol buffer"


def _flaws(content: memoryview) -> Iterator[str]:
    """Parts of a model that are refused. Fields are not collected: a hostile file has millions of them."""
    too_many = 2 * len(content) + 1
    waiting = [(_MODEL, content)]
    while waiting:
        kind, message = waiting.pop()
        refused = _REFUSED.get(kind, {})
        inner = _INNER_MESSAGES[kind]
        last: dict[int, memoryview | int | None] = {}  # of a field that is repeated, the last one holds
        n_numbers = 1
        for number, value in _fields(message):
            last[number] = value & 0xFFFFFFFF if isinstance(value, int) else value
            if number in refused:
                yield refused[number]
            if (kind, number) in _DIMENSIONS and value is not None:
                dimensions = (value,) if isinstance(value, int) else _varints(value)
                n_numbers = _product(n_numbers, dimensions, too_many)
            if number in inner and isinstance(value, memoryview):
                waiting.append((inner[number], value))
        if _makes_text(kind, last):
            yield "text"
        if n_numbers == too_many:
            yield "a tensor of more numbers than the file holds"


def _makes_text(kind: int, fields: dict[int, memoryview | int | None]) -> bool:
    """Whether a message is a tensor of text, or an attribute by which a node makes one."""
    if kind == _TENSOR:
        return fields.get(_TENSOR_TYPE) == _TEXT
    name = fields.get(_ATTRIBUTE_NAME)
    if kind != _ATTRIBUTE or not isinstance(name, memoryview):
        return False
    label = bytes(name)
    return label == b"value_string" or (label == b"to" and fields.get(_ATTRIBUTE_INTEGER) == _TEXT)


def _product(start: int, factors: Iterable[int], limit: int) -> int:
    """Product of numbers that are not negative, or limit where it is greater.

    It is cut at every factor: the exact product of a million dimensions takes minutes. A later 0 makes it 0.
    """
    product = start
    for factor in factors:
        product = min(product * factor, limit)
    return product


def _varints(packed: memoryview) -> Iterator[int]:
    """The numbers in a packed field."""
    position = 0
    while position < len(packed):
        number, position = _varint(packed, position)
        yield number


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview | int | None]]:
    """Number of each field of a message, and its bytes or its whole number; None for numbers of a fixed size.

    Raises:
        IndexError, ValueError: it is no message.
    """
    position = 0
    while position < len(message):
        key, position = _varint(message, position)
        if key >> 32:  # other readers would drop the bits beyond
            raise ValueError("no such field")
        wire_type = key & 7
        value: memoryview | int | None = None
        if wire_type == _VARINT:
            value, position = _varint(message, position)
        elif wire_type == _BYTES:
            length, position = _varint(message, position)
            value = message[position : position + length]
            position += length
        elif wire_type in (_FOUR_BYTES, _EIGHT_BYTES):
            position += 4 if wire_type == _FOUR_BYTES else 8
        else:
            raise ValueError("no such wire type")
        if position > len(message):
            raise ValueError("a field beyond the end")
        yield key >> 3, value


def _varint(message: memoryview, position: int) -> tuple[int, int]:
    """The number at a position, and the position after it."""
    number = 0
    for shift in range(0, 70, 7):
        byte = message[position]
        position += 1
        number |= (byte & 0x7F) << shift
        if byte < 0x80:
            return number, position
    raise ValueError("a number without an end")
