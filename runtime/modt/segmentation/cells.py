"""Occupied grid cells, and their connected components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from modt.segmentation.grids import Int32, SqrtRangeGrid
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.point_columns import PointColumns
from modt.types import NONE, Bool, Float32, Int


@dataclass(frozen=True, slots=True)
class Cells:
    """Occupied cells of a grid."""

    row: Int32  # (C,) of the grid
    column: Int32  # (C,) of the grid
    low: Float32  # (C,) least height of the points above ground [m]
    high: Float32  # (C,) greatest height of the points above ground [m]
    entries: Int  # (C,) points in each

    def __len__(self) -> int:
        return len(self.row)


def occupied_cells(
    grid: SqrtRangeGrid, points: PointColumns, height: Float32
) -> tuple[Cells, Int, PointColumns, Int]:
    """Cells of (K,) points with (K,) heights [m], (C,) last point of each, those points, (K,) cell of each."""
    cells, sample, cell = _occupied(grid, *grid.row_column(points), height, height)
    return cells, sample, points.take(sample), cell


def _occupied(grid: SqrtRangeGrid, row: Int32, column: Int32, low: Float32, high: Float32) -> tuple[Cells, Int, Int]:
    """Cells of (K,) entries, (C,) last entry of each, (K,) cell of each entry."""
    sample, cell = grid.occupied(grid.flat_index(row, column))
    n = len(sample)
    bounds = label_min(low, cell, n), label_max(high, cell, n)
    return Cells(row[sample], column[sample], *bounds, np.bincount(cell, minlength=n)), sample, cell


def connect(grid: SqrtRangeGrid, cells: Cells, max_gap_m: Float32, use: Bool) -> Int:
    """(C,) connected component of each cell of the (C,) used ones, NONE for the others.

    Neighbours with a vertical gap below (C,) max_gap_m are connected. Components are numbered in the order of their
    first cells.
    """
    rows = slice(None) if use.all() else np.flatnonzero(use)
    low, high, gap_m = cells.low[rows], cells.high[rows], max_gap_m[rows]
    one, other = grid.neighbour_pairs(grid.flat_index(cells.row[rows], cells.column[rows]))
    gap = np.maximum(low.take(one), low.take(other))
    gap -= np.minimum(high.take(one), high.take(other))
    near = np.flatnonzero(gap < gap_m.take(one))
    ends = np.zeros(len(low) + 1, np.int32)
    np.cumsum(np.bincount(one.take(near), minlength=len(low)), out=ends[1:])
    graph = csr_array((np.ones(len(near)), other.take(near), ends), shape=(len(low), len(low)))
    component = np.full(len(cells), NONE)
    component[rows] = connected_components(graph, directed=False)[1]
    return component


def connect_coarse(grid: SqrtRangeGrid, cells: Cells, max_gap_m: Float32) -> Int:
    """(C,) connected component of the cell of the grid, twice as wide, in which each cell lies.

    The gap of a wide cell is that of its last cell; wide cells are in the order of their last cells.
    """
    wide, sample, place = _occupied(grid, cells.row >> 1, cells.column >> 1, cells.low, cells.high)
    return connect(grid, wide, max_gap_m.take(sample), np.ones(len(wide), np.bool_)).take(place)
