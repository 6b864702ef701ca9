"""Arrays as arguments of C."""

from __future__ import annotations

import ctypes
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Signatures = Mapping[str, tuple[Any, Sequence[Any]]]
"""Result and arguments of every function."""
FLOAT32, FLOAT64, INT32, INT64, BOOL = map(np.dtype, (np.float32, np.float64, np.int32, np.int64, np.bool_))


def declare(library: ctypes.CDLL, signatures: Signatures) -> None:
    """Tell the library what its functions take and return."""
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


def at(numbers: NDArray[Any], kind: np.dtype[Any] = FLOAT32) -> int:
    """Address of a contiguous array of this kind.

    Raises:
        TypeError: it is not.
    """
    if numbers.dtype is not kind and numbers.dtype != kind:
        raise TypeError(f"a contiguous array of {kind} is needed, not of {numbers.dtype}")
    return address(numbers)


def address(numbers: Any) -> int:
    """Address of a contiguous array; `from_buffer` is several times faster than what NumPy offers for it.

    Raises:
        TypeError: it is not contiguous.
    """
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(numbers))
    except (TypeError, ValueError):  # read-only, empty, or not contiguous
        if not numbers.flags.c_contiguous:
            raise TypeError("a contiguous array is needed") from None
        data: int = numbers.__array_interface__["data"][0]
        return data


def pointers(*arrays: NDArray[Any]) -> array[int]:
    """A C structure of pointers to contiguous arrays, and to each row of those of two dimensions."""
    addresses: list[int] = []
    for numbers in arrays:
        first, rows = address(numbers), 1 if numbers.ndim == 1 else len(numbers)
        step = numbers.strides[0]
        addresses += [first + i * step for i in range(rows)]
    return array("Q", addresses)
