"""Arrays as text for a page: columns of differences, byte by byte, deflated, in base64."""

from __future__ import annotations

import base64
import zlib

import numpy as np

from modt.types import Int
from modt.viewer.point_cells import Cells

LEVEL = 6
"""Level of the compression; higher ones take longer and gain little."""
CELL_BYTES = 3
NUMBER_BYTES = 4


def packed(data: bytes, level: int = LEVEL) -> str:
    """Text of bytes; the page undoes it by `atob` and `DecompressionStream("deflate")`."""
    return base64.b64encode(zlib.compress(data, level)).decode("ascii")


def planes(numbers: Int, n_bytes: int) -> bytes:
    """Lowest bytes of all numbers, then the next lowest. Equal bytes lie together and compress well."""
    each = np.ascontiguousarray(numbers, "<i8").view(np.uint8).reshape(-1, 8)
    return each[:, :n_bytes].T.tobytes()


def differences(numbers: Int) -> Int:
    """(n,) the first number, then what is added to each to get the next."""
    return np.diff(numbers, prepend=0)


def packed_cells(cells: Cells, level: int = LEVEL) -> str:
    """Cells of a sweep: differences of the cells in CELL_BYTES planes, then the levels."""
    return packed(planes(differences(cells.cell), CELL_BYTES) + planes(cells.level, 1), level)


def packed_table(table: Int, level: int = LEVEL) -> str:
    """(R, C) table, column by column: differences in NUMBER_BYTES planes."""
    return packed(b"".join(planes(differences(column), NUMBER_BYTES) for column in table.T), level)
