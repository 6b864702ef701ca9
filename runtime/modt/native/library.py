"""The compiled passes in this process, and arrays as their arguments."""

from __future__ import annotations

import ctypes
import platform
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.native import build

Signatures = Mapping[str, tuple[Any, Sequence[Any]]]
"""Result and arguments of every function."""
_start: Any = (ctypes.c_char * 0).from_buffer
"""Start of a contiguous, writable array: several times faster than what NumPy offers for it."""


def declare(library: ctypes.CDLL, signatures: Signatures) -> None:
    """Tell the library what its functions take and return."""
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


class Given:
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


class Own:
    """An argument that is an array made for the call: result, scratch, or a structure."""

    from_param = staticmethod(_start)


FLOAT32, FLOAT64, INT32, INT64, BOOL = map(Given, (np.float32, np.float64, np.int32, np.int64, np.bool_))


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


def structure(*fields: NDArray[Any] | int) -> array[int]:
    """A C structure of pointers to contiguous arrays, and of 64-bit numbers."""
    return array("Q", [field if isinstance(field, int) else address(field) for field in fields])


def pointers(*arrays: NDArray[Any]) -> array[int]:
    """A C structure of pointers to contiguous arrays, and to each row of those of two dimensions."""
    addresses: list[int] = []
    for numbers in arrays:
        first, rows = address(numbers), 1 if numbers.ndim == 1 else len(numbers)
        step = numbers.strides[0] or 1  # of an empty one
        addresses += range(first, first + rows * step, step)
    return array("Q", addresses)


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
    machine, remedy = platform.machine(), "install modt again where a C compiler is"
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
