"""DDS types of the ROS 2 messages that are received and sent.

Cyclone DDS checks a message against its type in C, so the types are whole. Its deserialiser makes a Python object of
every number; these types keep the bytes instead, which the other modules of this package read and write.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from cyclonedds import idl

from modt.ros2.definitions import DEFINITIONS

TYPES: Any = idl.types
PRIMITIVES: dict[str, Any] = {"string": str, "bool": bool}


@cache
def message_type(name: str) -> type[Any]:
    """A type whose objects are made of the bytes of a message, and keep them as `message`."""
    kind: type[Any] = _struct(name)

    def make(self: Any, message: bytes) -> None:
        self.message = message

    kind.__init__ = make
    kind.serialize = lambda self, *_, **__: self.message
    kind.deserialize = classmethod(lambda cls, message, *_, **__: cls(message))
    kind.deserialize_key = classmethod(lambda _cls, *_, **__: None)  # for the notice that a sender has left
    return kind


@cache
def _struct(name: str) -> Any:
    package, _, short = name.partition("/")
    fields = (field.split() for field in DEFINITIONS[name].split(", "))
    made = {field: _type(kind) for kind, field in fields}
    return idl.make_idl_struct(short, f"{package}::msg::dds_::{short}_", made)


def _type(kind: str) -> Any:
    element, bracket, size = kind.rstrip("]").partition("[")
    single = _struct(element) if "/" in element else PRIMITIVES.get(element) or getattr(TYPES, element)
    if not bracket:
        return single
    return TYPES.array[single, int(size)] if size else TYPES.sequence[single]
