"""Low things, which lie on the ground, and the feet of what stands on it.

Index spaces: K tall points and L low ones above the ground, P points of low things in D cells, and G groups of these
cells. A *place* is an index among the K + L.
"""

from __future__ import annotations

import math

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.cell_clusterer import CellClusterer
from modt.segmentation.cells import AirOfCells
from modt.segmentation.cluster_sizes import ClusterSizes
from modt.segmentation.clusters import Clusters
from modt.segmentation.groups import consecutive
from modt.segmentation.kernels import Above, Kernels
from modt.segmentation.tuning import CellTuning, LowTuning, SplitTuning
from modt.types import NONE, Int, Int8, PointKind

ANY_GAP = CellTuning(max_gap_m=np.inf, max_gap_beams=0.0)
NO_SPLIT = SplitTuning(min_extent_m=np.inf)


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

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig, kernels: Kernels, tuning: LowTuning) -> None:
        self.kernels = kernels
        self.tuning = tuning
        self.max_sqrt_range = math.sqrt(tuning.max_range_m)
        self.clusterer = CellClusterer(sensor, config, ANY_GAP, NO_SPLIT)
        self.grid = self.clusterer.fine

    def find(self, above: Above, tall: Clusters) -> tuple[Clusters, Int, Int]:
        """Clusters of low things and feet, given those of the K tall points.

        Returns:
            Clusters of P points.
            (P,) places of these points.
            (2, F) places of the points at the foot of something, and for each the place of a tall point of that.
        """
        places, beside = self.kernels.low_points(
            self.clusterer.fine, above.points, above.is_clear, tall, self.max_sqrt_range
        )
        points = above.points.take(places)
        height = above.height_m.take(places)
        cells, sample, sampled, cell_of_point = self.kernels.occupied_cells(self.clusterer.fine, points, height)
        no_beam_m = np.zeros(len(cells), np.float32)  # neighbours are connected whatever the gap (ANY_GAP)
        group_of_cell, sizes, _ = self.kernels.cluster(self.clusterer, cells, sampled, no_beam_m)
        standing_of_cell = self._standing_of_cell(beside.take(sample), group_of_cell, sizes)
        is_foot = standing_of_cell != NONE
        kind_of_group = self._kind(sizes)
        kind_of_cell = np.where(is_foot, np.int8(PointKind.FOOT), kind_of_group.take(group_of_cell))
        is_thing = np.bincount(group_of_cell[kind_of_cell == PointKind.MEMBER], minlength=len(sizes)) > 0
        cluster_of_cell = np.where(is_foot, NONE, consecutive(is_thing).take(group_of_cell))
        clusters = Clusters(
            points,
            height,
            cell_of_point,
            cells,
            sample,
            sampled,
            cluster_of_cell,
            kind_of_cell,
            int(is_thing.sum()),
            AirOfCells.none(len(cells)),
        )
        foot = is_foot.take(cell_of_point).nonzero()[0]
        feet = np.stack([places.take(foot), standing_of_cell.take(cell_of_point.take(foot))])
        return clusters, places, feet

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
