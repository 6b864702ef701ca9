"""The compiled passes in this process, with arrays and structures as their arguments."""

from __future__ import annotations

import ctypes
import platform
import struct
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.native import build

_start: Any = (ctypes.c_char * 0).from_buffer
"""Start of a contiguous, writable array: several times faster than what NumPy offers for it."""


class ArrayArgument:
    """An argument that is a contiguous array of one kind; another one is a ctypes.ArgumentError."""

    def __init__(self, kind: type) -> None:
        self._kind = np.dtype(kind)

    def from_param(self, numbers: NDArray[Any]) -> Any:
        """The array as ctypes passes it."""
        if numbers.dtype is not self._kind and numbers.dtype != self._kind:
            raise TypeError(f"a contiguous array of {self._kind} is needed, not of {numbers.dtype}")
        try:
            return _start(numbers)
        except (TypeError, ValueError):
            return ctypes.c_void_p(address(numbers))


class OutputArgument:
    """An argument that is an array made for the call: result, scratch, or a structure."""

    from_param = staticmethod(_start)


def address(numbers: Any) -> int:
    """Address of a contiguous array.

    Raises:
        TypeError: it is not contiguous.
    """
    try:
        return ctypes.addressof(_start(numbers))
    except (TypeError, ValueError):  # read-only, or not contiguous
        if not numbers.flags.c_contiguous:
            raise TypeError("a contiguous array is needed") from None
        data: int = numbers.__array_interface__["data"][0]
        return data


@dataclass(frozen=True)
class Member:
    """A member of a C structure.

    Attributes:
        kind: "number"; "array", a pointer to one; or "rows", a pointer to each row of one.
        dtype: type of the number, or of the elements of the array.
        shape: size of each axis of the array. A name stands for a size that is known when a structure is filled; it
            is the same size wherever the name occurs in a layout.
    """

    kind: str
    dtype: np.dtype[Any]
    shape: tuple[int | str, ...] = ()

    @property
    def format(self) -> str:
        """Format of the member in the module `struct`."""
        if self.kind == "rows":
            return f"{self.shape[0]}P"
        return "P" if self.kind == "array" else self.dtype.char

    def fault(self, value: Any) -> str | None:
        """Reason why a value cannot be the member, whatever its sizes; None if it can."""
        if self.kind == "number":
            try:
                struct.pack(self.format, value)
            except struct.error as error:
                return f"is {value!r}: {error}"
        elif getattr(value, "dtype", None) != self.dtype:
            return f"is of {getattr(value, 'dtype', type(value).__name__)}"
        elif value.ndim != len(self.shape):
            return f"has {value.ndim} axes"
        elif not value.flags.c_contiguous:
            return "is not contiguous"
        return None

    def __str__(self) -> str:
        return f"{self.dtype} ({', '.join(map(str, self.shape))})" if self.shape else str(self.dtype)


def _picker(places: list[int]) -> Callable[[tuple[int, ...]], tuple[int, ...]]:
    """Function that picks the entries at some places of a tuple; a comprehension takes several times as long."""
    if len(places) == 1:
        return itemgetter(slice(places[0], places[0] + 1))
    return itemgetter(*places)


class Filled(bytes):
    """A filled structure. It keeps alive the arrays that it points to."""

    layout: Layout
    arrays: list[NDArray[Any]]


class Layout:
    """A structure of the C sources. It fills such structures, and is the type of an argument that points to one.

    Args:
        name: name of the structure in C.
        members: the members in the order of the C declaration.
    """

    def __init__(self, name: str, **members: Member) -> None:
        self.name = name
        self.members = members
        arrays = {name: member.shape for name, member in members.items() if member.kind != "number"}
        # Each size is taken from one place: the number of its name, or the first axis that has it.
        self._places: dict[str, tuple[str, int | None]] = {}
        for array_name, shape in arrays.items():
            for axis, size in enumerate(shape):
                if isinstance(size, str):
                    self._places.setdefault(size, (size, None) if size in members else (array_name, axis))
        # Shapes are picked from the sizes in the order of their places, followed by the sizes that are constant.
        self._constants = tuple([size for shape in arrays.values() for size in shape if isinstance(size, int)])
        known = [*self._places, *self._constants]
        self._pick_shape = {name: _picker([known.index(size) for size in shape]) for name, shape in arrays.items()}
        alignment = "0q"
        self._pack = struct.Struct("".join(member.format for member in members.values()) + alignment).pack

    def __call__(self, **values: Any) -> Filled:
        """Fill a structure with a number or a contiguous array for each member.

        Raises:
            TypeError: a member is missing, unknown, of another type, or not contiguous.
            ValueError: an array has another shape, or members disagree about a size.
        """
        return self._filled(values)

    def of(self, source: object, **others: Any) -> Filled:
        """Fill a structure: members from `others`, the rest from attributes of `source` with the same names."""
        for name in self.members:
            if name not in others:
                others[name] = getattr(source, name)
        return self._filled(others)

    def allocate(self, **numbers: int) -> Filled:
        """Fill a structure with new arrays, whose contents are undefined. The numbers are the sizes of the arrays."""
        known = (*[numbers[size] for size in self._places], *self._constants)
        arrays = {name: np.empty(pick(known), self.members[name].dtype) for name, pick in self._pick_shape.items()}
        return self._filled(arrays | numbers)

    def from_param(self, filled: Filled) -> Filled:
        """The structure as ctypes passes it."""
        if filled.layout is not self:
            raise TypeError(f"a structure {self.name} is needed, not {filled.layout.name}")
        return filled

    def _filled(self, values: dict[str, Any]) -> Filled:
        """Structure of these values, checked in one pass, since many are filled in a frame."""
        try:
            known = self._sizes(values)
            arrays = []
            fields: list[Any] = []
            for name, member in self.members.items():
                value = values[name]
                if member.kind == "number":
                    fields.append(value)
                    continue
                if value.dtype != member.dtype or value.shape != self._pick_shape[name](known):
                    raise TypeError
                arrays.append(value)
                first = address(value)
                if member.kind == "array":
                    fields.append(first)
                else:
                    step = value.strides[0] or 1  # of an empty array
                    fields.extend(range(first, first + len(value) * step, step))
            filled = Filled(self._pack(*fields))
        except (AttributeError, IndexError, KeyError, TypeError, struct.error):
            raise self._refusal(values) from None
        if len(values) != len(self.members):
            raise self._refusal(values)
        filled.layout = self
        filled.arrays = arrays
        return filled

    def _sizes(self, values: dict[str, Any]) -> tuple[int, ...]:
        """Sizes in the order of their places, and the constant ones."""
        sizes = []
        for name, axis in self._places.values():
            value = values[name]
            sizes.append(value if axis is None else value.shape[axis])
        return (*sizes, *self._constants)

    def _refusal(self, values: dict[str, Any]) -> TypeError | ValueError:
        """Error that names the member which does not fit."""
        for name in sorted(values.keys() ^ self.members.keys()):
            return TypeError(f"{self.name}.{name} is {'missing' if name in self.members else 'unknown'}")
        for name, member in self.members.items():
            if fault := member.fault(values[name]):
                return TypeError(f"{self.name}.{name}, {member}, {fault}")
        known = self._sizes(values)
        for name, pick in self._pick_shape.items():
            if values[name].shape != pick(known):
                subject = f"{self.name}.{name}, {self.members[name]},"
                sizes = dict(zip(self._places, known, strict=False))  # the constants follow
                return ValueError(f"{subject} has the shape {values[name].shape}, where {sizes}")
        return TypeError(f"{self.name} cannot be filled")


X86_64_V3_FLAGS = frozenset(["avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"])


class NotAvailableError(Exception):
    """The compiled passes cannot be used; the message says why and what helps."""


def instructions(cpu_info: str) -> str:
    """Best set of instructions of a processor, given /proc/cpuinfo."""
    flags = next((line.partition(":")[2].split() for line in cpu_info.splitlines() if line.startswith("flags")), [])
    return build.X86_64_V3 if frozenset(flags) >= X86_64_V3_FLAGS else build.BASELINE


def load(folder: Path = build.FOLDER, cpu_info: Path = Path("/proc/cpuinfo")) -> tuple[ctypes.CDLL, str]:
    """The library for this processor, and its set of instructions.

    Raises:
        NotAvailableError: there is none, or it is made of other sources.
    """
    machine = platform.machine()
    remedy = "install modt again where a C compiler is"
    try:
        kind = instructions(cpu_info.read_text(errors="replace")) if machine == "x86_64" else build.BASELINE
    except OSError:
        kind = build.BASELINE
    path = folder / build.library_name(kind)
    if not path.is_file():
        raise NotAvailableError(f"not compiled for {machine}; {remedy}")
    try:
        library = ctypes.CDLL(str(path))
        library.modt_sources.restype = ctypes.c_char_p
        sources = library.modt_sources().decode()
    except (OSError, AttributeError) as error:
        raise NotAvailableError(f"{path.name} cannot be loaded ({error}); {remedy}") from None
    if sources != build.source_hash():
        raise NotAvailableError(f"{path.name} is compiled from other sources; {remedy}")
    return library, kind
