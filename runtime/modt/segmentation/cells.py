"""Occupied cells and what connects them.

Index spaces: K points above ground, C occupied cells.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modt.segmentation.grids import Int32, PointColumns, SqrtRangeGrid
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.overhang import levels_of
from modt.types import NONE, Bool, Float32, Int, Self


@dataclass(frozen=True)
class Cells:
    """Occupied cells of a grid."""

    row: Int32  # (C,) of the grid
    column: Int32  # (C,) of the grid
    levels: Int32  # (C,) levels of height with a point, a bit each
    low: Float32  # (C,) least height of the points above ground [m]
    high: Float32  # (C,) greatest height of the points above ground [m]
    entries: Int  # (C,) points in each

    def __len__(self) -> int:
        return len(self.row)


def occupied_cells(
    grid: SqrtRangeGrid, points: PointColumns, height: Float32
) -> tuple[Cells, Int, PointColumns, Int]:
    """Cells of (K,) points with (K,) heights [m], (C,) last point of each, those points, (K,) cell of each."""
    cells, sample, cell_of_point = _occupied(grid, *grid.row_column(points), levels_of(height), height, height)
    return cells, sample, points.take(sample), cell_of_point


def _occupied(
    grid: SqrtRangeGrid, row: Int32, column: Int32, levels: Int32, low: Float32, high: Float32
) -> tuple[Cells, Int, Int]:
    """Cells of (K,) entries, (C,) last entry of each, (K,) cell of each entry."""
    sample, cell = grid.occupied(grid.flat_index(row, column))
    n = len(sample)
    levels_of_cell = np.zeros(n, np.int32)
    np.bitwise_or.at(levels_of_cell, cell, levels)
    cells = Cells(
        row=row[sample],
        column=column[sample],
        levels=levels_of_cell,
        low=label_min(low, cell, n),
        high=label_max(high, cell, n),
        entries=np.bincount(cell, minlength=n),
    )
    return cells, sample, cell


def connect(grid: SqrtRangeGrid, cells: Cells, max_gap_m: Float32, use: Bool) -> Int:
    """(C,) connected component of each cell of the (C,) used ones, NONE for the others.

    Neighbours with a vertical gap below (C,) max_gap_m, taken at the first of both in the order of the grid, are
    connected. Components are numbered in the order of their first cells.
    """
    from scipy.sparse import csr_array  # large, and the compiled kernels do without
    from scipy.sparse.csgraph import connected_components

    # Indices from here on are ranks among the used cells, until `component[used]` at the end.
    used = slice(None) if use.all() else np.flatnonzero(use)
    low = cells.low[used]
    high = cells.high[used]
    one, other = grid.neighbour_pairs(grid.flat_index(cells.row[used], cells.column[used]))
    gap_m = np.maximum(low.take(one), low.take(other))
    gap_m -= np.minimum(high.take(one), high.take(other))
    near = np.flatnonzero(gap_m < max_gap_m[used].take(one))
    # The pairs are sorted by their first cell, so their second cells are the rows of a sparse matrix as they stand.
    row_ends = np.zeros(len(low) + 1, np.int32)
    np.cumsum(np.bincount(one.take(near), minlength=len(low)), out=row_ends[1:])
    graph = csr_array((np.ones(len(near)), other.take(near), row_ends), shape=(len(low), len(low)))
    component = np.full(len(cells), NONE)
    component[used] = connected_components(graph, directed=False)[1]
    return component


def connect_coarse(grid: SqrtRangeGrid, cells: Cells, max_gap_m: Float32) -> Int:
    """(C,) connected component of the cell of the grid, twice as wide, in which each cell lies.

    The gap of a wide cell is that of its last cell; wide cells are in the order of their last cells.
    """
    wide, sample, wide_of_cell = _occupied(
        grid, cells.row >> 1, cells.column >> 1, cells.levels, cells.low, cells.high
    )
    return connect(grid, wide, max_gap_m.take(sample), np.ones(len(wide), np.bool_)).take(wide_of_cell)


@dataclass(frozen=True)
class AirOfCells:
    """How solid C cells are (`modt.segmentation.porosity`)."""

    beam_m: Float32  # (C,) vertical distance of neighbouring beams [m]
    solidity: Float32  # (C,) share of the rays there that end there; 1 where it was not looked for
    airborne: Bool  # (C,) cells of returns from the air
    returns: int  # number of returns in airborne cells
    share: float  # their share of all returns that were looked at

    @classmethod
    def none(cls, n: int) -> Self:
        """No air in n cells."""
        return cls(np.ones(n, np.float32), np.ones(n, np.float32), np.zeros(n, np.bool_), 0, 0.0)

    def followed_by(self, cells: Int) -> Self:
        """The air of all cells, then that of some of them again."""
        return replace(
            self,
            beam_m=np.concatenate([self.beam_m, self.beam_m[cells]]),
            solidity=np.concatenate([self.solidity, self.solidity[cells]]),
            airborne=np.concatenate([self.airborne, self.airborne[cells]]),
        )
