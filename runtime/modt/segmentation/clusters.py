"""Euclidean clusters: occupied cells of a bird's-eye grid whose spacing grows with range, joined where they touch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.car_merging import Bounds, Pieces
from modt.segmentation.columns import Columns
from modt.segmentation.grids import Int32, RootGrid
from modt.segmentation.groups import Groups
from modt.segmentation.person_splitting import Silhouettes
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


@dataclass(frozen=True, slots=True)
class Sizes:
    """How large clusters are, some of them empty.

    Attributes:
        held: (G,) points.
        extent: (G,) diagonal of the upright rectangle about it [m].
        low, top: (G,) least and greatest height above ground [m].
        root: (G,) square root of its range, about [sqrt(m)].
        of_vast: (G,) a piece of something larger than objects are.
    """

    held: Int
    extent: Float32
    low: Float32
    top: Float32
    root: Float32
    of_vast: Bool

    def of_wholes(self, whole: Int) -> Sizes:
        """The same with clusters gathered into others, given (G,) which; those that are gathered lie empty.

        Extents stay those of the first pieces: Pieces makes nothing larger than an object.
        """
        n = len(whole)
        held = np.bincount(whole, self.held, n).astype(np.int64)
        low, top = _least(self.low, whole, n), _most(self.top, whole, n)
        return replace(self, held=held, low=low, top=top)


def join(grid: RootGrid, cells: Cells, beam_rad: float) -> Int:
    """(C,) component of each cell: those that touch at a side or a corner, and in height, belong together."""
    one, other = grid.beside(grid.place(cells.row, cells.column))
    gap = np.maximum(cells.low.take(one), cells.low.take(other))
    gap -= np.minimum(cells.high.take(one), cells.high.take(other))
    bound = np.float32(GAP_M) + np.float32(GAP_BEAMS * beam_rad) * np.square(cells.root)
    near = np.flatnonzero(gap < bound.take(one))
    ends = np.zeros(len(cells) + 1, np.int32)
    np.cumsum(np.bincount(one.take(near), minlength=len(cells)), out=ends[1:])
    graph = csr_array((np.ones(len(near)), other.take(near), ends), shape=(len(cells), len(cells)))
    component: Int = connected_components(graph, directed=False)[1].astype(np.int64)
    return component


class Clusterer:
    """Gathers points into clusters that could be objects.

    A first grid joins what is one thing even where it is thinly seen. What grows vast that way (a wall, a hedge, and
    whoever stands against them) is taken apart again on a grid of half the spacing, of which it keeps what stands
    out as an object of its own. Then people are parted from whom and what they stand beside, and cars made whole.

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
        self.pieces = Pieces(sensor, config.max_extent_m)

    def cluster(self, points: Columns, height: Float32) -> Clusters:
        """Clusters of (K,) points, K > 0, of a height above ground [m]."""
        row, column = self.fine.row_and_column(points)
        sample, cell = self.fine.occupy(self.fine.place(row, column))
        low, high = _least(height, cell, len(sample)), _most(height, cell, len(sample))
        cells = Cells(row[sample], column[sample], low, high, points.root[sample])
        seen = points.take(sample)
        cluster, sizes = self._joined(cells, seen, np.bincount(cell))
        proper = self._proper(sizes)
        company = proper & self.silhouettes.company(sizes.extent, sizes.top, sizes.held, sizes.root)
        parted, n = self.silhouettes.parted(points, height, cell, cluster, company)
        piece = self.pieces.possible(sizes.extent, sizes.top, sizes.held, sizes.root) & (proper | ~sizes.of_vast)
        piece[cluster[parted >= len(piece)]] = False
        whole = self._whole(cells, seen, seen.z - height[sample], cluster, piece)
        proper = np.append(self._proper(sizes.of_wholes(whole)), np.ones(n - len(piece), np.bool_))
        number = np.where(proper, np.cumsum(proper) - 1, NONE)
        of_cell = number[np.append(whole, np.arange(len(piece), n))[parted]]
        return Clusters(cell, sample, cells.high, of_cell, int(proper.sum()))

    def _joined(self, cells: Cells, points: Columns, count: Int) -> tuple[Int, Sizes]:
        """(C,) cluster of each cell, given a point of each and (C,) how many it has; and how large they are."""
        cluster = self._joined_coarsely(cells)
        extent = _extent(points.x, points.y, cluster)
        parts = np.flatnonzero((extent >= self.config.max_extent_m)[cluster])
        piece = join(self.fine, cells.take(parts), self.beam_rad)
        cluster[parts] = piece + len(extent)
        extents = np.append(extent, _extent(points.x[parts], points.y[parts], piece))
        n = len(extents)
        held = np.bincount(cluster, count, n).astype(np.int64)
        low, top = _least(cells.low, cluster, n), _most(cells.high, cluster, n)
        root = np.zeros(n, np.float32)
        root[cluster] = cells.root
        return cluster, Sizes(held, extents, low, top, root, np.arange(n) >= len(extent))

    def _joined_coarsely(self, fine: Cells) -> Int:
        """(C,) cluster of each fine cell: that of the coarse cell which it is a quarter of."""
        row, column = fine.row >> 1, fine.column >> 1
        sample, coarse = self.coarse.occupy(self.coarse.place(row, column))
        low, high = _least(fine.low, coarse, len(sample)), _most(fine.high, coarse, len(sample))
        cells = Cells(row[sample], column[sample], low, high, fine.root[sample])
        return join(self.coarse, cells, self.beam_rad)[coarse]

    def _proper(self, sizes: Sizes) -> Bool:
        """(G,) clusters of an object's size; pieces of something vast must stand out."""
        proper: Bool = (sizes.held >= self.config.min_points) & (sizes.extent < self.config.max_extent_m)
        proper &= sizes.top - sizes.low >= self.config.min_height_m
        proper &= ~sizes.of_vast | ((sizes.top >= STANDS_OUT_M) & (sizes.held >= STANDS_OUT_POINTS))
        return proper

    def _whole(self, cells: Cells, points: Columns, ground: Float32, cluster: Int, piece: Bool) -> Int:
        """(G,) first cluster of the car that each is a piece of, itself where it is of none.

        Args:
            cells: what clusters consist of.
            points: (C,) a point of each cell.
            ground: (C,) height of the ground beneath it [m, sensor frame].
            cluster: (C,) cluster of each cell.
            piece: (G,) clusters that may be pieces.
        """
        whole = np.arange(len(piece))
        rows = np.flatnonzero(piece)
        if len(rows):
            groups = Groups.of(np.where(piece, np.cumsum(piece) - 1, NONE)[cluster], len(rows))
            whole[rows] = rows[self.pieces.whole(Bounds.of(points, ground, cells.low, cells.high, groups))]
        return whole


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
