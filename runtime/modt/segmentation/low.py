"""Low things, which lie on the ground, and the feet of what stands on it.

Index spaces: K tall points and L low ones above the ground, P points of low things in D cells, and G groups of these
cells. A *place* is an index among the K + L.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.cells import CellClusterer, Clusters, ClusterSizes
from modt.segmentation.grids import Int32
from modt.segmentation.groups import consecutive
from modt.segmentation.kernels import NUMPY, Above, Kernels
from modt.segmentation.tuning import CellTuning, LowTuning, SplitTuning
from modt.types import NONE, Int, Int8, PointKind

ANY_GAP = CellTuning(max_gap_m=np.inf, max_gap_beams=0.0)
NO_SPLIT = SplitTuning(min_extent_m=np.inf)


@dataclass(frozen=True, slots=True)
class LowThings:
    """Clusters of low points, and feet.

    Attributes:
        clusters: of P points.
        places: (P,) places of those points.
        feet: (2, F) places of points at the foot of something, and of a point each of that.
    """

    clusters: Clusters
    places: Int
    feet: Int


class LowFinder:
    """Finds things that are lower than what is clustered, and feet, near the sensor.

    Low points that are clear of the roughness of the ground, and tall ones whose clusters are too low or too sparse,
    are grouped by neighbouring cells. Cells beside something tall are its foot. A group that stands alone is a thing
    of its own. Low points that are not clear of the ground belong to what shares their cell, else they are ground.

    Args:
        sensor: range and spacing of points.
        config: clustering distance.
        kernels: passes over points and cells.
        tuning: bounds on low things.
    """

    def __init__(
        self,
        sensor: SensorConfig,
        config: SegmentationConfig,
        kernels: Kernels = NUMPY,
        tuning: LowTuning = LowTuning(),
    ) -> None:
        self.kernels = kernels
        self.tuning = tuning
        self.max_sqrt_range = np.float32(np.sqrt(tuning.max_range_m))
        self.clusterer = CellClusterer(sensor, config, ANY_GAP, NO_SPLIT)
        self.grid = self.clusterer.fine
        # Wide cells are two by two fine ones. What stands in each is NONE throughout between calls.
        self.side = self.grid.side // 2 + 1
        self.standing = np.full(self.side * self.side, NONE)
        self.has_clear = np.zeros(self.side * self.side, np.bool_)
        step = np.arange(-1, 2)
        self.around = (self.side * step[:, None] + step).ravel()

    def find(self, above: Above, tall: Clusters) -> LowThings:
        """Low things and feet, given the clusters of the K tall points."""
        kind = tall.kind_of_cell
        is_standing = (kind == PointKind.MEMBER.value) | (kind == PointKind.STRUCTURE.value)
        is_standing &= tall.sampled.sqrt_range < self.max_sqrt_range
        cells_standing = is_standing.nonzero()[0]
        wide_standing = self._wide(tall.cells.row.take(cells_standing), tall.cells.column.take(cells_standing))
        self.standing[wide_standing] = tall.sample.take(cells_standing)
        places = self._places(above, tall)
        points = above.points.take(places)
        height = above.height_m.take(places)
        cells, sample, sampled, cell_of_point = self.kernels.occupied_cells(self.grid, points, height)
        beside = self.standing.take(self._wide(cells.row, cells.column)[:, None] + self.around).max(axis=1)
        self.standing[wide_standing] = NONE

        any_beam_m = np.zeros(len(cells), np.float32)
        group_of_cell, sizes = self.kernels.cluster(self.clusterer, cells, sampled, any_beam_m)
        standing_of_cell = self._standing_of_cell(beside, group_of_cell, sizes)
        is_foot = standing_of_cell != NONE
        kind_of_group = self._kind(sizes)
        kind_of_cell = np.where(is_foot, np.int8(PointKind.FOOT), kind_of_group.take(group_of_cell))
        is_thing = np.bincount(group_of_cell[kind_of_cell == PointKind.MEMBER], minlength=len(sizes)) > 0
        cluster_of_cell = np.where(is_foot, NONE, consecutive(is_thing).take(group_of_cell))
        clusters = Clusters(
            points, height, cell_of_point, cells, sample, sampled, cluster_of_cell, kind_of_cell, int(is_thing.sum())
        )
        foot = is_foot.take(cell_of_point).nonzero()[0]
        feet = np.stack([places.take(foot), standing_of_cell.take(cell_of_point.take(foot))])
        return LowThings(clusters, places, feet)

    def _places(self, above: Above, tall: Clusters) -> Int:
        """(P,) places of left-over tall points, clear low ones, and low ones that share a wide cell."""
        n_tall = above.n_tall
        kind = tall.kind_of_cell
        is_left_over = (kind == PointKind.LOW.value) | (kind == PointKind.SPARSE.value)
        is_left_over &= tall.sampled.sqrt_range < self.max_sqrt_range
        left_over = is_left_over.take(tall.cell_of_point).nonzero()[0]
        low = above.points.part(n_tall, len(above.rows))
        wide = self._wide(*self.grid.row_column(low))
        wide_clear = wide[above.is_clear]
        self.has_clear[wide_clear] = True
        used = self.has_clear.take(wide) | (self.standing.take(wide) != NONE)
        self.has_clear[wide_clear] = False
        return np.concatenate([left_over, n_tall + used.nonzero()[0]])

    def _standing_of_cell(self, beside: Int, group_of_cell: Int, sizes: ClusterSizes) -> Int:
        """(D,) place of a tall point that each cell is the foot of, NONE where there is none.

        It is one beside the cell, given (D,) such places, or beside another cell of its group, if that is small.
        """
        standing_of_group = np.full(len(sizes), NONE)
        np.maximum.at(standing_of_group, group_of_cell, beside)
        standing_of_group[sizes.extent_m > self.tuning.max_foot_m] = NONE
        standing: Int = np.maximum(beside, standing_of_group.take(group_of_cell))
        return standing

    def _kind(self, sizes: ClusterSizes) -> Int8:
        """(G,) PointKind of each group that stands alone."""
        tuning = self.tuning
        range_m = np.square(sizes.sqrt_range)
        enough = sizes.points >= tuning.min_points
        small = (sizes.extent_m < tuning.max_extent_m) & ~sizes.of_oversized
        kind = np.full(len(sizes), PointKind.GROUND, np.int8)
        kind[(sizes.top_m > tuning.sparse_top_m) | (range_m < tuning.sparse_range_m)] = PointKind.SPARSE
        kind[enough] = PointKind.LOW
        kind[enough & small] = PointKind.MEMBER
        return kind

    def _wide(self, row: Int32, column: Int32) -> Int:
        """Wide cell of each fine one."""
        return (row >> 1).astype(np.int64) * self.side + (column >> 1)
