"""Clusters of cells, and sizes of clusters."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from modt.class_sizes import SPLIT_PERSON
from modt.config import SegmentationConfig, SensorConfig
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
    def of_cells(cls, cells: Cells, points: PointColumns, beam_m: Float32, cluster: Int) -> Self:
        """Sizes of clusters by (C,) a point of each cell, the distance of beams there [m], its cluster or NONE."""
        n, has = int(cluster.max(initial=NONE)) + 1, np.flatnonzero(cluster != NONE)
        label, cell = cluster.take(has), np.zeros(n, np.int64)
        cell[label] = has
        x, y, low, high = (v.take(has) for v in (points.x, points.y, cells.low, cells.high))
        width, depth = (label_max(v, label, n) - label_min(v, label, n) for v in (x, y))
        return cls(
            points=np.bincount(label, cells.entries.take(has), n).astype(np.int64),
            extent_m=np.sqrt(np.square(width) + np.square(depth)),
            bottom_m=label_min(low, label, n),
            top_m=label_max(high, label, n),
            sqrt_range=points.sqrt_range.take(cell),
            cell=cell,
            beam_m=beam_m.take(cell),
            is_part=np.zeros(n, np.bool_),
        )

    def followed_by(self, other: Self) -> Self:
        """These clusters, then the others."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return type(self)(*(np.concatenate(pair) for pair in pairs))

    def merged(self, target: Int) -> ClusterSizes:
        """Sizes after merging each cluster into its (G,) target; those merged into another are empty.

        The extent stays that of the target: merging is limited to the size of an object.
        """
        points, bottom_m, top_m = self.points.copy(), self.bottom_m.copy(), self.top_m.copy()
        moved = (target != np.arange(len(target))).nonzero()[0]  # few
        into, points[moved] = target[moved], 0
        np.add.at(points, into, self.points[moved])
        np.minimum.at(bottom_m, into, self.bottom_m[moved])
        np.maximum.at(top_m, into, self.top_m[moved])
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


MAX_CELL_GAP_M, MAX_CELL_GAP_BEAMS = 0.3, 2.0
"""Neighbouring cells with a vertical gap below the sum, the beams taken at their range, are one cluster."""
MIN_SPLIT_M, MIN_CELL_RETURNS = 0.8, 0.9
"""A cluster of this extent may hold a person and more, where a fine cell is as wide as so many spacings of points."""
MIN_PERSON_POINTS = 8
"""Least number of points of a person that is split off."""


class CellClusterer:
    """Clusters of cells: those of a coarse grid, and parts of them on a grid of half the spacing.

    Args:
        sensor: range and spacing of points.
        config: clustering distance and sizes of objects.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        step = config.cell_m / np.sqrt(10.0)
        self.max_extent_m = config.max_extent_m
        self.coarse = SqrtRangeGrid(step, sensor.max_range_m)
        self.fine = SqrtRangeGrid(step / 2, sensor.max_range_m)
        spacing = MIN_CELL_RETURNS * np.deg2rad(sensor.azimuth_step_deg)
        self.max_split_sqrt_range = np.float32(self.fine.step / spacing)  # a cell is as wide as step * sqrt(range)

    def cluster(self, cells: Cells, points: PointColumns, beam_m: Float32) -> tuple[Int, ClusterSizes]:
        """(C,) cluster of each cell, given one point of each and the distance of beams there [m]; their sizes."""
        max_gap_m = np.float32(MAX_CELL_GAP_M) + np.float32(MAX_CELL_GAP_BEAMS) * beam_m
        cluster = connect_coarse(self.coarse, cells, max_gap_m)
        coarse = ClusterSizes.of_cells(cells, points, beam_m, cluster)
        oversized = coarse.extent_m >= self.max_extent_m
        again = (oversized | self._may_hold_person(coarse)).take(cluster)
        part = connect(self.fine, cells, max_gap_m, again)
        parts = ClusterSizes.of_cells(cells, points, beam_m, part)
        owner = cluster.take(parts.cell)
        of_oversized = oversized.take(owner)
        split = of_oversized | self._may_be_person(parts)
        number = np.full(len(parts) + 1, NONE)  # the last is that of NONE
        number[:-1][split] = len(coarse) + split.nonzero()[0]
        cluster = np.maximum(number.take(part), cluster)  # parts follow the clusters
        whole = np.bincount(owner, parts.points * split, len(coarse))
        coarse, parts = (
            replace(coarse, points=coarse.points - whole.astype(np.int64)),
            replace(parts, points=parts.points * split, is_part=of_oversized),
        )
        return cluster, coarse.followed_by(parts)

    def _may_hold_person(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that may hold a person and more, near enough for the fine grid to hold an object together."""
        may: Bool = (sizes.extent_m > MIN_SPLIT_M) & (sizes.top_m > SPLIT_PERSON.min_top_m)
        may &= (sizes.points >= 2 * MIN_PERSON_POINTS) & (sizes.sqrt_range < self.max_split_sqrt_range)
        return may

    def _may_be_person(self, sizes: ClusterSizes) -> Bool:
        """(G,) parts of a person's size."""
        return (sizes.points >= MIN_PERSON_POINTS) & SPLIT_PERSON.fits(sizes.extent_m, sizes.bottom_m, sizes.top_m)


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
