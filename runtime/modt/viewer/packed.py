"""Arrays as text for a page: each number less the one before it, byte by byte, deflated, in base64."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass

import numpy as np

from modt.types import Float32, Int, Int8, PointKind

LEVEL = 6
"""Level of the compression. Higher ones take longer and gain little."""
CELL_BYTES = 3
"""Bytes of the number of a cell."""
NUMBER_BYTES = 4
"""Bytes of a number of a table."""


def packed(data: bytes, level: int = LEVEL) -> str:
    """Text of bytes. The page reads it by `atob` and `DecompressionStream("deflate")`."""
    return base64.b64encode(zlib.compress(data, level)).decode("ascii")


def planes(numbers: Int, n_bytes: int) -> bytes:
    """Lowest bytes of all numbers, then the next lowest. Equal bytes lie together and compress well."""
    each = np.ascontiguousarray(numbers, "<i8").view(np.uint8).reshape(-1, 8)
    return each[:, :n_bytes].T.tobytes()


def packed_cells(cells: Cells, level: int = LEVEL) -> str:
    """Cells of a sweep: differences of the cells in CELL_BYTES planes, then a byte each, LEVELS * group + level."""
    look = LEVELS * cells.group + cells.level
    return packed(planes(np.diff(cells.cell, prepend=0), CELL_BYTES) + planes(look, 1), level)


def packed_table(table: Int, level: int = LEVEL) -> str:
    """(R, C) table, column by column: differences in NUMBER_BYTES planes."""
    return packed(b"".join(planes(column, NUMBER_BYTES) for column in np.diff(table, axis=0, prepend=0).T), level)


SIDE = 4096
"""Cells of the grid along x and along y. Three bytes count them all."""
LEVEL_M = 0.1
"""Height above ground of one level [m]. Level 0 is ground."""
LEVELS = 64
"""Number of levels; the highest one holds all greater heights."""
LOOKS = 256
"""Number of pairs of a group and a level."""
PLAIN = 3
"""Group of the points that are drawn by their height alone."""
_GROUPS = {
    PointKind.GROUND: 0,
    PointKind.OVERHEAD: 0,
    PointKind.LOW: 1,
    PointKind.SPARSE: 1,
    PointKind.AIRBORNE: 1,
    PointKind.STRUCTURE: 2,
}
"""Kinds that are drawn alike, as in `theme.kinds`; others are PLAIN. A greater group is drawn over a smaller one."""


def group_of(kind: Int8) -> Int:
    """(N,) group of points by their PointKind."""
    by_kind = np.full(len(PointKind), PLAIN)
    by_kind[[-each for each in _GROUPS]] = [*_GROUPS.values()]
    return by_kind.take(-kind)


@dataclass(frozen=True)
class Cells:
    """The occupied cells of a sweep, each once for every height and group of its points.

    They are ordered by their numbers, then by group and height: what is drawn last lies on top.
    """

    cell: Int  # (n,) SIDE * row + column, ascending; column and row count from -x and -y, the sensor at SIDE / 2
    level: Int  # (n,) height above ground [LEVEL_M], 0 for ground
    group: Int  # (n,) as of group_of

    def thinned(self, most: int) -> Cells:
        """Cells, `most` of them at most. Cells of the ground are left out first."""
        above = _spread(np.flatnonzero(self.level > 0), most)
        ground = _spread(np.flatnonzero(self.level == 0), most - len(above))
        rows = np.sort(np.concatenate([above, ground]))
        return Cells(self.cell[rows], self.level[rows], self.group[rows])


def _spread(rows: Int, most: int) -> Int:
    """Rows, `most` of them at most, evenly spread."""
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows), most, endpoint=False).astype(np.int64)]


def occupied(x: Float32, y: Float32, level: Int, group: Int, step_cm: int) -> Cells:
    """Cells of points x, y [m] within the grid."""
    column, row = (np.floor(v * (100 / step_cm)).astype(np.int64) + SIDE // 2 for v in (x, y))
    code = np.sort((SIDE * row + column) * LOOKS + LEVELS * group + level)  # np.unique takes six times as long
    cell, look = np.divmod(code[np.append(True, np.diff(code) > 0)[: len(code)]], LOOKS)
    group, level = np.divmod(look, LEVELS)
    return Cells(cell, level, group)
