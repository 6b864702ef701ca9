"""Arrays as arguments of C."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray

Signatures = Mapping[str, tuple[Any, Sequence[Any]]]
"""Result and arguments of every function."""


def declare(library: ctypes.CDLL, signatures: Signatures) -> None:
    """Tell the library what its functions take and return."""
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


def at(array: NDArray[Any], kind: DTypeLike = np.float32) -> int:
    """Address of a contiguous array of this kind.

    Raises:
        TypeError: it is not.
    """
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"a contiguous array of {np.dtype(kind)} is needed, not of {array.dtype}")
    return address(array)


def address(array: NDArray[Any]) -> int:
    """Address of a contiguous array; `from_buffer` is twenty times faster than what NumPy offers for it."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(cast(Any, array)))
    except (TypeError, ValueError):  # read-only, or empty
        data: int = array.__array_interface__["data"][0]
        return data


def pointers(*arrays: NDArray[Any]) -> Any:
    """A C structure of pointers to contiguous arrays, and to each row of those of two dimensions."""
    addresses: list[int] = []
    for array in arrays:
        first, rows = address(array), 1 if array.ndim == 1 else len(array)
        addresses += (first + i * array.strides[0] for i in range(rows))
    return (ctypes.c_void_p * len(addresses))(*addresses)
