"""Points that may be low things or feet."""

from __future__ import annotations

import numpy as np

from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import Int32, PointColumns, SqrtRangeGrid
from modt.types import NONE, Bool, Int, PointKind


def low_points(
    grid: SqrtRangeGrid, points: PointColumns, is_clear: Bool, tall: Clusters, max_sqrt_range: float
) -> tuple[Int, Int]:
    """(P,) places of what may be low things or feet, and (P,) place of a tall point beside each, or NONE.

    These are tall points whose clusters are too low or too sparse, low ones that are clear of the ground, and low
    ones that share a wide cell with one of these or with something tall. A wide cell is two by two of the grid.

    Args:
        grid: fine cells.
        points: (K + L,) tall points, then low ones.
        is_clear: (L,) low points that are clear of the roughness of the ground.
        tall: clusters of the K.
        max_sqrt_range: range up to which tall points are looked at [sqrt(m)].
    """
    side = grid.side // 2 + 1
    kind = np.where(tall.sampled.sqrt_range < np.float32(max_sqrt_range), tall.kind_of_cell, PointKind.GROUND)
    cells = np.flatnonzero((kind == PointKind.MEMBER) | (kind == PointKind.STRUCTURE))
    standing = np.full(side * side, NONE)  # by wide cell: a tall point of an object or a structure in it
    standing[_wide(tall.cells.row[cells], tall.cells.column[cells], side)] = tall.sample[cells]
    left_over = np.flatnonzero(((kind == PointKind.LOW) | (kind == PointKind.SPARSE)).take(tall.cell_of_point))
    wide = _wide(*grid.row_column(points), side)
    low = wide[len(points) - len(is_clear) :]  # of the low points, which are the last
    has_clear = np.zeros(side * side, np.bool_)
    has_clear[low[is_clear]] = True
    used = np.flatnonzero(has_clear[low] | (standing[low] != NONE))
    places = np.concatenate([left_over, len(points) - len(is_clear) + used])
    step = np.arange(-1, 2)
    around = (side * step[:, None] + step).ravel()
    return places, standing.take(wide[places][:, None] + around).max(axis=1)


def _wide(row: Int32, column: Int32, side: int) -> Int:
    """Wide cell of each fine one, by its number."""
    return (row >> 1).astype(np.int64) * side + (column >> 1)
