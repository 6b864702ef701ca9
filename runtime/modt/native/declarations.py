"""Structures and functions of the C sources, as they are declared there.

In a structure that Python fills, `SHAPE(sizes)` follows the arrays of a declaration.
"""

from __future__ import annotations

import ctypes
import re
from functools import cache
from typing import Any

import numpy as np

from modt.native import build
from modt.native.library import ArrayArgument, Layout, Member, OutputArgument

NUMBERS: dict[str, Any] = {
    "double": np.float64,
    "float": np.float32,
    "u4": np.float32,
    "int": np.intc,
    "i32": np.int32,
    "i64": np.int64,
    "int8_t": np.int8,
    "uint8_t": np.bool_,
}
"""Type in NumPy of the elements of each numeric type. Four floats are one vector (u4)."""


@cache
def _code(pattern: str) -> str:
    """Text of the source files of a name, without comments."""
    text = "".join(path.read_text() for path in sorted(build.FOLDER.glob(pattern)))
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


@cache
def _bodies() -> dict[str, str]:
    """Declarations of the members of every structure, by its name."""
    return {name: body for body, name in re.findall(r"typedef struct {([^}]*)} (\w+);", _code("*.[ch]"))}


@cache
def structure(name: str) -> Layout:
    """Layout of a structure of the C sources.

    A name alone is a number, `*name[k]` a pointer to each of k rows of an array, and any other pointer an array.
    """
    members = {}
    for declaration in _bodies()[name].split(";")[:-1]:
        text, _, shape = declaration.replace("const ", "").rstrip(" )").partition(" SHAPE(")
        sizes = tuple(int(size) if size.isdecimal() else size for size in shape.split(", "))
        kind, declarators = text.split(maxsplit=1)
        for pointer, member, rows in re.findall(r"(\(?\*)?(\w+)\)?(\[\w+\])*", declarators):
            form = "number" if not pointer else "rows" if pointer == "*" and rows else "array"
            members[member] = Member(form, np.dtype(NUMBERS[kind]), sizes if pointer else ())
    return Layout(name, **members)


def declare(library: ctypes.CDLL, *files: str) -> None:
    """Tell the library what the functions that these files export take and return."""
    for result, name, arguments in re.findall(r"EXPORT (\w+) (\w+)\(([^{;]*)\)\s*{", "".join(map(_code, files))):
        function = getattr(library, name)
        function.restype = _number(result)
        function.argtypes = [*map(_argument, arguments.split(","))]


def _argument(declaration: str) -> Any:
    """Type of an argument. The plain arrays that a function writes are made for the call, and not checked."""
    kind = declaration.replace("const ", "").split()[0]
    if "*" not in declaration and "[" not in declaration:
        return _number(kind)
    if kind[0].isupper():
        return structure(kind)
    checked = kind in NUMBERS and ("const " in declaration or "(*" in declaration)
    return ArrayArgument(NUMBERS[kind]) if checked else OutputArgument


def _number(kind: str) -> Any:
    """Type of a number; None for `void`."""
    return None if kind == "void" else np.ctypeslib.as_ctypes_type(NUMBERS[kind])
