"""Occupied cells, clusters of cells, sizes of clusters, and points by cluster.

Index spaces: K points above ground, C occupied cells, and clusters, G of them while some may be empty or invalid,
n at the end.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from modt.class_sizes import PersonSize
from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.grids import FAR_M, Int32, PointColumns, SqrtRangeGrid
from modt.segmentation.groups import Groups, consecutive, label_max, label_min
from modt.segmentation.overhang import Overhangs, levels_of, standing_top_m
from modt.segmentation.structure import find_surfaces
from modt.segmentation.tuning import CellTuning, ClusterTuning, OverhangTuning, SplitTuning, StructureTuning
from modt.types import NONE, Bool, Float32, Int, Int8, PointKind, Self


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
class ClusterSizes:
    """Sizes of G clusters, some of them empty."""

    points: Int  # (G,) number of points
    cell: Int  # (G,) last cell of each
    extent_m: Float32  # (G,) diagonal of the axis-parallel rectangle [m]
    bottom_m: Float32  # (G,) least height above ground [m]
    top_m: Float32  # (G,) greatest height above ground [m]
    sqrt_range: Float32  # (G,) square root of the range of the last cell [sqrt(m)]
    beam_m: Float32  # (G,) vertical distance of neighbouring beams there [m]
    of_oversized: Bool  # (G,) part of an oversized cluster; False for a person split off another one

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def of_cells(cls, cells: Cells, sampled: PointColumns, beam_m: Float32, cluster: Int) -> Self:
        """Sizes of clusters by (C,) a point of each cell, the distance of beams there [m], its cluster or NONE."""
        n = int(cluster.max(initial=NONE)) + 1
        used = np.flatnonzero(cluster != NONE)
        label = cluster.take(used)
        last = np.zeros(n, np.int64)
        np.maximum.at(last, label, used)
        low = cells.low.take(used)
        high = cells.high.take(used)
        x, y = (column.take(used) for column in (sampled.x, sampled.y))
        width, depth = (label_max(v, label, n) - label_min(v, label, n) for v in (x, y))
        return cls(
            points=np.bincount(label, cells.entries.take(used), n).astype(np.int64),
            cell=last,
            extent_m=np.sqrt(np.square(width) + np.square(depth)),
            bottom_m=label_min(low, label, n),
            top_m=label_max(high, label, n),
            sqrt_range=sampled.sqrt_range.take(last),
            beam_m=beam_m.take(last),
            of_oversized=np.zeros(n, np.bool_),
        )

    def followed_by(self, other: Self) -> Self:
        """These clusters, then the others."""
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return type(self)(*(np.concatenate(pair) for pair in pairs))

    def merged(self, target: Int) -> ClusterSizes:
        """Sizes after merging each cluster into its (G,) target; those merged into another are empty.

        The extent stays that of the target: merging is limited to the size of an object.
        """
        points = self.points.copy()
        bottom_m = self.bottom_m.copy()
        top_m = self.top_m.copy()
        moved = (target != np.arange(len(target))).nonzero()[0]  # few
        into = target[moved]
        points[moved] = 0
        np.add.at(points, into, self.points[moved])
        np.minimum.at(bottom_m, into, self.bottom_m[moved])
        np.maximum.at(top_m, into, self.top_m[moved])
        return replace(self, points=points, bottom_m=bottom_m, top_m=top_m)


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


@dataclass(frozen=True)
class Clusters:
    """K points above ground in C cells, and cells in n clusters."""

    points: PointColumns
    height: Float32  # (K,) above ground [m]
    cell_of_point: Int  # (K,)
    cells: Cells
    sample: Int  # (C,) last point of each cell
    sampled: PointColumns  # (C,) that point
    cluster_of_cell: Int  # (C,) NONE where it cannot be an object
    kind_of_cell: Int8  # (C,) PointKind of its points, MEMBER of a cluster
    n: int
    air: AirOfCells

    def select(self, keep: Bool, kind: PointKind) -> Clusters:
        """The clusters of an (n,) mask, renumbered; the points of the others are of a kind."""
        if keep.all():
            return self
        clustered = np.flatnonzero(self.cluster_of_cell != NONE)
        cluster_of_cell = np.full(len(self.cells), NONE)
        cluster_of_cell[clustered] = consecutive(keep)[self.cluster_of_cell[clustered]]
        dropped = clustered[cluster_of_cell[clustered] == NONE]
        kind_of_cell = self.kind_of_cell.copy()
        kind_of_cell[dropped] = kind
        return replace(self, cluster_of_cell=cluster_of_cell, kind_of_cell=kind_of_cell, n=int(keep.sum()))


class CellClusterer:
    """Clusters of cells: those of a coarse grid, and parts of them on a grid of half the spacing.

    Args:
        sensor: range and spacing of points.
        config: clustering distance and sizes of objects.
        cells: gap between neighbouring cells of one cluster.
        split: parts that are a person.
        structure: surfaces, and parts before them.
        kept: points and height of a part that stands out.
        overhang: people below what hangs.
    """

    def __init__(
        self,
        sensor: SensorConfig,
        config: SegmentationConfig,
        cells: CellTuning = CellTuning(),
        split: SplitTuning = SplitTuning(),
        structure: StructureTuning = StructureTuning(),
        kept: ClusterTuning = ClusterTuning(),
        overhang: OverhangTuning = OverhangTuning(),
    ) -> None:
        self.gap = cells
        self.split = split
        self.structure = structure
        self.kept = kept
        self.overhang = overhang
        self.max_extent_m = config.max_extent_m
        step = config.cell_m / np.sqrt(10.0)
        # Points are placed on the fine grid alone, and a coarse cell is two by two fine ones. So the centre of the
        # coarse grid, which is not half that of the fine one, is never used. It has at most as many rows.
        self.coarse = SqrtRangeGrid(step, sensor.max_range_m)
        self.fine = SqrtRangeGrid(step / 2, sensor.max_range_m)
        # A cell is step * sqrt(range) wide, and returns of a beam are range * azimuth_step apart.
        spacing = split.min_cell_returns * np.deg2rad(sensor.azimuth_step_deg)
        self.max_split_sqrt_range = np.float32(self.fine.step / spacing)

    def cluster(self, cells: Cells, sampled: PointColumns, beam_m: Float32) -> tuple[Int, ClusterSizes, Overhangs]:
        """(C,) cluster of each cell, given one point of each and the distance of beams there [m]; sizes; what hangs.

        Every cell is in a cluster. The parts that were tried come after the clusters of the coarse grid. A part that
        is not split off keeps its number, with no points. Of a cluster that parts leave, only `points` is corrected;
        its other sizes include what left.
        """
        max_gap_m = np.float32(self.gap.max_gap_m) + np.float32(self.gap.max_gap_beams) * beam_m
        # 1. The coarse grid holds far objects together, whose returns are sparse. It also joins neighbours.
        cluster = connect_coarse(self.coarse, cells, max_gap_m)
        sizes = ClusterSizes.of_cells(cells, sampled, beam_m, cluster)
        oversized = sizes.extent_m >= np.float32(self.structure.oversized_m)
        divided = oversized | self._may_hold_person(sizes)

        # 2. Clusters that it may have joined wrongly are tried on the fine grid.
        part = connect(self.fine, cells, max_gap_m, divided.take(cluster))
        parts = ClusterSizes.of_cells(cells, sampled, beam_m, part)
        of_oversized = oversized.take(cluster.take(parts.cell))
        parts = replace(parts, of_oversized=of_oversized)
        leaves = of_oversized | self._may_be_person(parts, self.split.person)
        cluster, sizes = moved(cells, cluster, sizes, part, parts, leaves)

        # 3. What stands before the long surfaces of the clusters that are left leaves them.
        free, before_m, surface_top_m = self._before_surfaces(cells, sampled, cluster, sizes)
        part = connect(self.fine, cells, max_gap_m, free)
        parts = ClusterSizes.of_cells(cells, sampled, beam_m, part)
        extent_m = sizes.extent_m.take(cluster.take(parts.cell))
        leaves = self._leaves_surface(parts, part, before_m, surface_top_m.take(parts.cell), extent_m)
        cluster, sizes = moved(cells, cluster, sizes, part, parts, leaves)

        # 4. Who stands below something that hangs leaves it.
        return self._people_below(cells, sampled, beam_m, max_gap_m, cluster, sizes)

    def _people_below(
        self,
        cells: Cells,
        sampled: PointColumns,
        beam_m: Float32,
        max_gap_m: Float32,
        cluster: Int,
        sizes: ClusterSizes,
    ) -> tuple[Int, ClusterSizes, Overhangs]:
        """(C,) cluster of each cell and sizes, after people have left what hangs above them, and what hangs.

        Neighbours with a vertical gap below (C,) max_gap_m are connected.
        """
        top_m = standing_top_m(cells.row, cells.column, cells.levels, cells.high, beam_m, self.overhang)
        standing = replace(cells, high=top_m)
        part = connect(self.fine, standing, max_gap_m, self._may_stand_below(cells, top_m, beam_m, cluster, sizes))
        parts = ClusterSizes.of_cells(standing, sampled, beam_m, part)
        below = (part != NONE) & (top_m < cells.high)
        leaves = self._leaves_overhang(parts, part, below)
        divided_cells = np.flatnonzero(below)
        divided_cells = divided_cells[leaves.take(part.take(divided_cells))]
        hanging = Overhangs.above(divided_cells, top_m, cluster)
        return *moved(cells, cluster, sizes, part, parts, leaves), hanging

    def _may_stand_below(
        self, cells: Cells, top_m: Float32, beam_m: Float32, cluster: Int, sizes: ClusterSizes
    ) -> Bool:
        """(C,) cells that stand, up to (C,) top_m [m], in clusters that may hold a person and what hangs above."""
        tuning = self.overhang
        tried = (sizes.extent_m > self.split.min_extent_m) & (sizes.points >= 2 * self.split.min_points)
        tried &= sizes.top_m > np.float32(tuning.min_top_m)
        tried &= sizes.sqrt_range * sizes.sqrt_range < np.float32(tuning.max_range_m)
        stands = (top_m > 0) & (cells.low <= np.float32(self.structure.hanging_m))
        stands &= np.float32(tuning.gap_beams) * beam_m <= np.float32(tuning.max_gap_m)
        may: Bool = tried.take(cluster) & stands
        return may

    def _leaves_overhang(self, parts: ClusterSizes, part: Int, below: Bool) -> Bool:
        """(parts,) possible people, given (C,) the part of each cell or NONE, and if something hangs above it."""
        tuning = self.overhang
        n_cells = np.bincount(part[part != NONE], minlength=len(parts))
        n_below = np.bincount(part[below], minlength=len(parts))
        leaves = self._may_be_person(parts, self.split.person) & (parts.points >= tuning.min_points)
        leaves &= parts.top_m < np.float32(tuning.max_person_m)
        leaves &= parts.bottom_m < np.float32(self.structure.max_bottom_m)
        leaves &= n_below >= tuning.min_share * n_cells
        return leaves

    def _before_surfaces(
        self, cells: Cells, sampled: PointColumns, cluster: Int, sizes: ClusterSizes
    ) -> tuple[Bool, Float32, Float32]:
        """(C,) cells of long clusters that are on no surface, distance of each before surfaces, and their top [m].

        The distance is infinite where no surface reaches. The top is that of all surfaces of the cluster of the cell,
        infinite without any. Cells of clusters without a surface are not free, except those below a canopy, which
        count as far before it.
        """
        tuning = self.structure
        tried = (sizes.points >= 2 * self.split.min_points) & (sizes.top_m > np.float32(self.split.person.min_top_m))
        tried &= sizes.extent_m >= np.float32(tuning.min_extent_m)
        tried &= sizes.sqrt_range * sizes.sqrt_range < np.float32(tuning.max_range_m)
        n = int(np.count_nonzero(tried))
        free = np.zeros(len(cells), np.bool_)
        before_m, surface_top_m = np.full((2, len(cells)), np.inf, np.float32)
        groups = Groups.from_labels(consecutive(tried).take(cluster), n)
        width_m = self.fine.step * sampled.sqrt_range.astype(np.float64)
        for members in np.split(groups.rows, groups.offsets[1:-1]) if n else ():
            hanging = cells.low[members] > np.float32(tuning.hanging_m)
            canopy = np.count_nonzero(hanging) >= tuning.min_hanging * len(members)
            rows = members[~hanging] if canopy else members
            x, y = (column[rows].astype(np.float64) for column in (sampled.x, sampled.y))
            on_surface, distance_m = find_surfaces(x, y, width_m[rows], tuning)
            if on_surface.any():
                before_m[rows] = distance_m
                surface_top_m[rows] = cells.high[rows[on_surface]].max()
            elif canopy:
                before_m[rows] = FAR_M  # finite: what stands below a canopy may leave it
            else:
                continue
            free[rows] = ~on_surface
        return free, before_m, surface_top_m

    def _leaves_surface(
        self, parts: ClusterSizes, part: Int, before_m: Float32, surface_top_m: Float32, extent_m: Float32
    ) -> Bool:
        """(parts,) parts that leave their clusters.

        Before a surface, or across it, are possible people and, if the cluster is oversized, what stands out. Behind
        it are possible people of whom it shows head and shoulders. From a cluster that is longer than any object all
        leaves that stands out.

        Args:
            parts: sizes of the parts.
            part: (C,) part of each cell, or NONE.
            before_m: (C,) distance of each cell before surfaces [m].
            surface_top_m: (parts,) greatest height of the surfaces of the cluster of each part [m].
            extent_m: (parts,) extent of the cluster of each part.
        """
        tuning = self.structure
        cell = np.flatnonzero((part != NONE) & (before_m < np.inf))
        front_m = label_max(before_m.take(cell), part.take(cell), len(parts))
        back_m = label_min(before_m.take(cell), part.take(cell), len(parts))
        thickness_m = np.float32(tuning.thickness_m)
        across = (back_m < -thickness_m) & (front_m > -thickness_m)
        across &= front_m - back_m > np.float32(tuning.min_across_m)
        before = (front_m > np.float32(tuning.min_before_m)) | across
        before &= back_m > -np.float32(tuning.max_behind_m)
        person = self._may_be_person(parts, self.split.person) & (parts.bottom_m < np.float32(tuning.max_bottom_m))
        behind = (front_m < 0) & (back_m > -np.float32(tuning.max_hidden_m))
        behind &= parts.top_m > surface_top_m + np.float32(tuning.min_above_m)
        hidden_person = self._may_be_person(parts, self.split.hidden_person) & behind
        stands_out = parts.points >= self.kept.min_part_points
        stands_out &= parts.top_m >= np.float32(self.kept.min_part_top_m)
        stands_out &= parts.extent_m >= np.float32(tuning.min_part_extent_m)
        oversized = extent_m >= np.float32(tuning.oversized_m)
        endless = extent_m >= np.float32(self.max_extent_m)
        leaves: Bool = (before & (person | (oversized & stands_out))) | hidden_person | (endless & stands_out)
        return leaves

    def _may_hold_person(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that may hold a person and more, near enough for the fine grid to hold an object together."""
        split = self.split
        may: Bool = (sizes.extent_m > split.min_extent_m) & (sizes.top_m > split.person.min_top_m)
        may &= (sizes.points >= 2 * split.min_points) & (sizes.sqrt_range < self.max_split_sqrt_range)
        return may

    def _may_be_person(self, sizes: ClusterSizes, person: PersonSize) -> Bool:
        """(G,) parts of a person's size."""
        fits = person.fits(sizes.extent_m, sizes.bottom_m, sizes.top_m)
        return (sizes.points >= self.split.min_points) & fits


def moved(
    cells: Cells, cluster: Int, sizes: ClusterSizes, part: Int, parts: ClusterSizes, leaves: Bool
) -> tuple[Int, ClusterSizes]:
    """(C,) cluster of each cell, and sizes, after some of the (C,) parts have left their clusters.

    Parts are numbered after the clusters. One that stays keeps its number, with no points. Of a cluster that parts
    leave, only the number of points is corrected. A part may have cells of several clusters.
    """
    in_part = np.flatnonzero(part != NONE)
    moving = in_part[leaves.take(part.take(in_part))]
    gone = np.bincount(cluster.take(moving), cells.entries.take(moving), len(sizes)).astype(np.int64)
    after = cluster.copy()
    after[moving] = len(sizes) + part[moving]
    left = replace(sizes, points=sizes.points - gone)
    return after, left.followed_by(replace(parts, points=parts.points * leaves))


def set_apart(
    found: Clusters, cluster: Int, sizes: ClusterSizes, hanging: Overhangs
) -> tuple[Clusters, Int, ClusterSizes]:
    """The cells, (C,) cluster of each and sizes, after what hangs above people has got cells of its own."""
    cells = np.flatnonzero(hanging.cluster != NONE)
    if not len(cells):
        return found, cluster, sizes
    number = np.full(len(cluster), NONE)
    number[cells] = np.arange(len(cells))
    is_hanging = found.height > hanging.below_m.take(found.cell_of_point)
    point = np.flatnonzero(is_hanging & (number.take(found.cell_of_point) != NONE))
    own = number.take(found.cell_of_point[point])
    entries = np.bincount(own, minlength=len(cells))
    points = sizes.points.copy()
    np.add.at(points, cluster[cells], -entries)
    np.add.at(points, hanging.cluster[cells], entries)
    cell_of_point = found.cell_of_point.copy()
    cell_of_point[point] = len(cluster) + own
    last = np.zeros(len(cells), np.int64)
    np.maximum.at(last, own, point)
    sample = np.concatenate([found.sample, last])
    apart = replace(
        found,
        cell_of_point=cell_of_point,
        cells=_divided(found.cells, cells, hanging.below_m[cells], own, found.height[point]),
        sample=sample,
        sampled=found.points.take(sample),
        air=found.air.followed_by(cells),
    )
    return apart, np.concatenate([cluster, hanging.cluster[cells]]), replace(sizes, points=points)


def _divided(cells: Cells, divided: Int, below_m: Float32, own: Int, height: Float32) -> Cells:
    """All cells, the n divided ones up to (n,) below_m [m], then n cells of the points above.

    Args:
        cells: before.
        divided: (n,) their numbers.
        below_m: (n,) height above which the points get cells of their own [m].
        own: (K,) number of the new cell of each of these points, from 0 on.
        height: (K,) their heights above ground [m].
    """
    n = len(divided)
    entries = np.bincount(own, minlength=n)
    high = cells.high.copy()
    high[divided] = below_m
    remaining = cells.entries.copy()
    remaining[divided] -= entries
    return Cells(
        row=np.concatenate([cells.row, cells.row[divided]]),
        column=np.concatenate([cells.column, cells.column[divided]]),
        levels=np.concatenate([cells.levels, cells.levels[divided]]),
        low=np.concatenate([cells.low, label_min(height, own, n)]),
        high=np.concatenate([high, label_max(height, own, n)]),
        entries=np.concatenate([remaining, entries]),
    )


@dataclass(frozen=True)
class Members:
    """M points by cluster, in the order of the sweep within a cluster."""

    offsets: Int  # (n + 1,) cluster i has the points from offsets[i] to offsets[i + 1]
    index: Int  # (M,) rows of the sweep
    columns: Float32  # (4, M) x, y, z, and z of the ground beneath [m, sensor frame]


def members_of(
    tall: Clusters, low: Clusters, places: Int, points: PointColumns, height: Float32, index: Int, kind: Int8
) -> Members:
    """Points of each tall cluster, then of each low one.

    Args:
        tall: clusters of the first K points.
        low: clusters of the points at (P,) places; of these they replace the tall ones.
        places: (P,) those places.
        points: (K + L,) points.
        height: (K + L,) their heights above ground [m].
        index: (K + L,) row of each in the sweep.
        kind: (N,) PointKind of all points of the sweep, into which those of the points go.
    """
    cluster = np.full(len(index), NONE)
    # Tall clusters come first, so that the low ones replace them where both have a point.
    for first, at, clusters in ((0, np.arange(len(tall.cell_of_point)), tall), (tall.n, places, low)):
        kind[index[at]] = clusters.kind_of_cell.take(clusters.cell_of_point)
        of_cell = np.where(clusters.cluster_of_cell == NONE, NONE, clusters.cluster_of_cell + first)
        cluster[at] = of_cell.take(clusters.cell_of_point)
    groups = Groups.from_labels(cluster, tall.n + low.n)
    x, y, z, height = (v.take(groups.rows) for v in (points.x, points.y, points.z, height))
    return Members(groups.offsets, index.take(groups.rows), np.stack([x, y, z, z - height]))


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
