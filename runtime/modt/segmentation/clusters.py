"""Euclidean clusters: occupied cells of a bird's-eye grid whose spacing grows with range, joined where they touch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.columns import Columns
from modt.segmentation.grids import Int32, RootGrid
from modt.segmentation.silhouettes import Silhouettes
from modt.types import NONE, Bool, Float32, Int

GAP_M = 0.3
"""Cells that touch in the bird's-eye view are joined if no more than this lies between them in height ..."""
GAP_BEAMS = 2.0
"""... and this many spacings between beams at their range."""
STANDS_OUT_M = 0.9
"""A piece of something vast is an object only if it rises this high above the ground ..."""
STANDS_OUT_POINTS = 15
"""... and has this many points."""


@dataclass(frozen=True, slots=True)
class Cells:
    """Occupied cells of a grid.

    Attributes:
        row, column: (C,) place in the grid, in row-major order.
        low, high: (C,) least and greatest height of its points above ground [m].
        root: (C,) square root of its range [sqrt(m)].
    """

    row: Int32
    column: Int32
    low: Float32
    high: Float32
    root: Float32

    def __len__(self) -> int:
        return len(self.row)

    def take(self, rows: Int) -> Cells:
        """The cells given."""
        return Cells(self.row[rows], self.column[rows], self.low[rows], self.high[rows], self.root[rows])


@dataclass(frozen=True, slots=True)
class Clusters:
    """Points gathered into cells, and cells into clusters.

    Attributes:
        cell: (K,) cell of each point.
        sample: (C,) one point of each cell, its last.
        top: (C,) greatest height above ground of each cell's points [m].
        of_cell: (C,) cluster of each cell, NONE where it could be no object.
        n: how many there are, numbered from 0.
    """

    cell: Int
    sample: Int
    top: Float32
    of_cell: Int
    n: int

    def kept(self, keep: Bool) -> Clusters:
        """The clusters that an (n,) mask keeps, numbered anew."""
        if keep.all():
            return self
        number = np.append(np.where(keep, np.cumsum(keep) - 1, NONE), NONE)  # the last one is that of NONE
        return replace(self, of_cell=number[self.of_cell], n=int(keep.sum()))


def join(grid: RootGrid, cells: Cells, beam_rad: float) -> Int:
    """(C,) component of each cell: those that touch at a side or a corner, and in height, belong together."""
    one, other = grid.beside(grid.place(cells.row, cells.column))
    gap = np.maximum(cells.low[one], cells.low[other]) - np.minimum(cells.high[one], cells.high[other])
    bound = np.float32(GAP_M) + np.float32(GAP_BEAMS * beam_rad) * np.square(cells.root)
    near = np.flatnonzero(gap < bound[one])
    ends = np.append(0, np.cumsum(np.bincount(one[near], minlength=len(cells))))
    graph = csr_array((np.ones(len(near)), other[near], ends), shape=(len(cells), len(cells)))
    component: Int = connected_components(graph, directed=False)[1].astype(np.int64)
    return component


class Clusterer:
    """Gathers points into clusters that could be objects.

    A first grid joins what is one thing even where it is thinly seen. What grows vast that way (a wall, a hedge, and
    whoever stands against them) is taken apart again on a grid of half the spacing, of which it keeps what stands
    out as an object of its own. Last, people are parted from whom and what they stand beside.

    Args:
        sensor: its range and the spacing of its beams.
        config: clustering distance and proper sizes.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        step = config.cell_m / np.sqrt(10.0)
        self.config = config
        self.beam_rad = float(np.deg2rad(sensor.elevation_step_deg))
        self.coarse = RootGrid(step, sensor.max_range_m)
        self.fine = RootGrid(step / 2, sensor.max_range_m)
        self.silhouettes = Silhouettes(sensor, config)

    def cluster(self, points: Columns, height: Float32) -> Clusters:
        """Clusters of (K,) points, K > 0, of a height above ground [m]."""
        row, column = self.fine.row_and_column(points)
        sample, cell = self.fine.occupy(self.fine.place(row, column))
        low, high = _least(height, cell, len(sample)), _most(height, cell, len(sample))
        cells = Cells(row[sample], column[sample], low, high, points.root[sample])
        count, x, y = np.bincount(cell), points.x[sample], points.y[sample]

        cluster = self._joined_coarsely(cells)
        extent = _extent(x, y, cluster)
        parts = np.flatnonzero((extent >= self.config.max_extent_m)[cluster])
        piece = join(self.fine, cells.take(parts), self.beam_rad)
        cluster[parts] = piece + len(extent)
        extents = np.append(extent, _extent(x[parts], y[parts], piece))
        top, held = _most(cells.high, cluster, len(extents)), np.bincount(cluster, count, len(extents))
        proper = self._proper(cluster, cells, held, extents, top, len(extent))
        number = np.where(proper, np.cumsum(proper) - 1, NONE)[cluster]
        root = np.zeros(len(extents), np.float32)
        root[cluster] = cells.root
        company = self.silhouettes.company(extents, top, held, root)[proper]
        of_cell, n = self.silhouettes.parted(points, height, cell, number, company)
        return Clusters(cell, sample, cells.high, of_cell, n)

    def _joined_coarsely(self, fine: Cells) -> Int:
        """(C,) cluster of each fine cell: that of the coarse cell which it is a quarter of."""
        row, column = fine.row >> 1, fine.column >> 1
        sample, coarse = self.coarse.occupy(self.coarse.place(row, column))
        low, high = _least(fine.low, coarse, len(sample)), _most(fine.high, coarse, len(sample))
        cells = Cells(row[sample], column[sample], low, high, fine.root[sample])
        return join(self.coarse, cells, self.beam_rad)[coarse]

    def _proper(self, cluster: Int, cells: Cells, points: Int, extent: Float32, top: Float32, n_coarse: int) -> Bool:
        """(G,) clusters of an object's size; pieces of something vast, numbered from n_coarse, must stand out."""
        low = _least(cells.low, cluster, len(extent))
        proper: Bool = (points >= self.config.min_points) & (extent < self.config.max_extent_m)
        proper &= top - low >= self.config.min_height_m
        proper[n_coarse:] &= (top[n_coarse:] >= STANDS_OUT_M) & (points[n_coarse:] >= STANDS_OUT_POINTS)
        return proper


def _least(values: Float32, group: Int, n: int) -> Float32:
    """(n,) least value of each group, infinite where it is empty."""
    least = np.full(n, np.inf, np.float32)
    np.minimum.at(least, group, values)
    return least


def _most(values: Float32, group: Int, n: int) -> Float32:
    """(n,) greatest value of each group, minus infinity where it is empty."""
    most = np.full(n, -np.inf, np.float32)
    np.maximum.at(most, group, values)
    return most


def _extent(x: Float32, y: Float32, group: Int) -> Float32:
    """(G,) diagonal of the upright rectangle about each group, infinite where it is empty [m]."""
    n = int(group.max(initial=NONE)) + 1
    diagonal: Float32 = np.hypot(*(_most(v, group, n) - _least(v, group, n) for v in (x, y)))
    return diagonal
