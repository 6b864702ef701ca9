"""Clusters of cells, and sizes of clusters."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from modt.segmentation.grids import Int32, PointColumns, SqrtRangeGrid
from modt.segmentation.groups import Groups, consecutive, label_max, label_min
from modt.types import NONE, Bool, Float32, Int, Self


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
    from scipy.sparse import csr_array  # large, and the compiled kernels do without
    from scipy.sparse.csgraph import connected_components

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


@dataclass(frozen=True, slots=True)
class ClusterBounds:
    """Bounds of n clusters of cells: of one point of each cell from above, of all points in height above ground."""

    min_x: Float32  # (n,) [m, sensor frame]
    max_x: Float32
    min_y: Float32
    max_y: Float32
    bottom: Float32  # (n,) [m]
    top: Float32
    points: Int  # (n,) number of points
    cell: Int  # (n,) last cell


@dataclass(frozen=True, slots=True)
class ClusterSizes:
    """Sizes of G clusters, some of them empty."""

    points: Int  # (G,) number of points
    extent_m: Float32  # (G,) diagonal of the axis-parallel rectangle [m]
    bottom_m: Float32  # (G,) least height above ground [m]
    top_m: Float32  # (G,) greatest height above ground [m]
    sqrt_range: Float32  # (G,) square root of the range of one cell [sqrt(m)]
    cell: Int  # (G,) that cell
    beam_m: Float32  # (G,) vertical distance of neighbouring beams there [m]
    is_part: Bool  # (G,) part of an oversized cluster

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def of_bounds(cls, bounds: ClusterBounds, points: PointColumns, beam_m: Float32) -> Self:
        """Sizes of clusters, given (C,) a point of each cell and the vertical distance of beams there [m]."""
        return cls(
            points=bounds.points,
            extent_m=np.sqrt(np.square(bounds.max_x - bounds.min_x) + np.square(bounds.max_y - bounds.min_y)),
            bottom_m=bounds.bottom,
            top_m=bounds.top,
            sqrt_range=points.sqrt_range.take(bounds.cell),
            cell=bounds.cell,
            beam_m=beam_m.take(bounds.cell),
            is_part=np.zeros(len(bounds.cell), np.bool_),
        )

    def followed_by(self, other: Self) -> Self:
        """These clusters, then the others."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return type(self)(*(np.concatenate(pair) for pair in pairs))

    def merged(self, target: Int) -> ClusterSizes:
        """Sizes after merging each cluster into its (G,) target; those merged into another are empty.

        The extent stays that of the target: merging is limited to the size of an object.
        """
        n = len(self)
        points = np.bincount(target, self.points, n).astype(np.int64)
        bottom_m, top_m = label_min(self.bottom_m, target, n), label_max(self.top_m, target, n)
        return replace(self, points=points, bottom_m=bottom_m, top_m=top_m)


@dataclass(frozen=True, slots=True)
class Clusters:
    """K points above ground in C cells, and cells in n clusters."""

    points: PointColumns
    height: Float32  # (K,) above ground [m]
    cell: Int  # (K,) cell of each point
    cells: Cells
    sample: Int  # (C,) last point of each cell
    sampled: PointColumns  # (C,) that point
    of_cell: Int  # (C,) cluster of each cell, NONE where it cannot be an object
    n: int

    def select(self, keep: Bool) -> Clusters:
        """The clusters of an (n,) mask, renumbered."""
        if keep.all():
            return self
        number = np.append(consecutive(keep), NONE)  # the last entry is that of NONE
        return replace(self, of_cell=number[self.of_cell], n=int(keep.sum()))


def cluster_bounds(cells: Cells, points: PointColumns, cluster: Int, n: int) -> ClusterBounds:
    """Bounds of n clusters, given (C,) the cluster of each cell, NONE where it has none, and a point of each cell."""
    has = cluster != NONE
    rows = slice(None) if has.all() else np.flatnonzero(has)
    label, cell = cluster[rows], np.zeros(n, np.int64)
    cell[label] = np.arange(len(cluster))[rows]
    x, y = points.x[rows], points.y[rows]
    return ClusterBounds(
        min_x=label_min(x, label, n),
        max_x=label_max(x, label, n),
        min_y=label_min(y, label, n),
        max_y=label_max(y, label, n),
        bottom=label_min(cells.low[rows], label, n),
        top=label_max(cells.high[rows], label, n),
        points=np.bincount(label, cells.entries[rows], n).astype(np.int64),
        cell=cell,
    )


@dataclass(frozen=True, slots=True)
class Members:
    """M points by cluster, in the order of the sweep within a cluster."""

    offsets: Int  # (n + 1,) cluster i owns the points from offsets[i] to offsets[i + 1]
    index: Int  # (M,) rows of the sweep
    columns: Float32  # (4, M) x, y, z, and z of the ground beneath [m, sensor frame]


def members_of(clusters: Clusters, index: Int) -> Members:
    """Points of each cluster, given (K,) the row of each point in the sweep."""
    groups, points = Groups.from_labels(clusters.of_cell.take(clusters.cell), clusters.n), clusters.points
    x, y, z, height = (v.take(groups.rows) for v in (points.x, points.y, points.z, clusters.height))
    return Members(groups.offsets, index.take(groups.rows), np.stack([x, y, z, z - height]))
