"""Connected cells, and parts that leave them: objects, and people before surfaces or below what hangs.

Index spaces: C occupied cells, clusters and parts of them, G of them while some may be empty.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.class_sizes import PersonSize
from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.cells import Cells, connect, connect_coarse
from modt.segmentation.cluster_sizes import ClusterSizes, moved
from modt.segmentation.grids import FAR_M, PointColumns, SqrtRangeGrid
from modt.segmentation.groups import Groups, consecutive, label_max, label_min
from modt.segmentation.overhang import Overhangs, standing_top_m
from modt.segmentation.structure import find_surfaces
from modt.segmentation.tuning import CellTuning, ClusterTuning, OverhangTuning, SplitTuning, StructureTuning
from modt.types import NONE, Bool, Float32, Int


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
