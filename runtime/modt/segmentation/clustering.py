"""Euclidean clustering (section III-A) on a bird's-eye grid whose spacing grows with range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.car_merging import StripMerger
from modt.segmentation.cells import Cells, connect, occupied_cells
from modt.segmentation.clusters import Clusters, ClusterSizes, diagonals
from modt.segmentation.grids import SqrtRangeGrid
from modt.segmentation.groups import consecutive, label_max, label_min
from modt.segmentation.person_splitting import PersonSplitter
from modt.segmentation.point_columns import PointColumns
from modt.types import Bool, Float32, Int


class Clusterer:
    """Clusters of points that can be objects.

    A coarse grid connects objects with sparse returns. An oversized cluster (a wall, a hedge and who stands in front
    of it) is clustered again on a grid of half the spacing; parts that stand out from it are kept.

    Args:
        sensor: range and beam spacing.
        config: clustering distance, sizes of objects, and the keys of `clusters`.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        step = config.cell_m / np.sqrt(10.0)
        self.config, self.beams = config, sensor.beams
        self.gap_m = np.float32(config.clusters.max_gap_m)
        self.gap_beams = np.float32(config.clusters.max_gap_beams)
        self.coarse = SqrtRangeGrid(step, sensor.max_range_m)
        self.fine = SqrtRangeGrid(step / 2, sensor.max_range_m)
        self.splitter, self.merger = PersonSplitter(sensor, config), StripMerger(sensor, config)

    def cluster(self, points: PointColumns, height: Float32) -> Clusters:
        """Clusters of (K,) points, K > 0, with (K,) heights above ground [m]."""
        row, column = self.fine.row_column(points)
        cells, sample, cell = occupied_cells(self.fine, row, column, height, height)
        cluster, sizes = self._connect(cells, points.take(sample), np.bincount(cell))
        n, valid = len(sizes), self._valid(sizes)
        clusters = Clusters(points, height, cell, cells, sample, cluster, n)
        split, total = self.splitter.split(clusters, valid & self.splitter.candidates(sizes), sizes.beam_m)
        mergeable = valid | ~sizes.is_part
        mergeable[cluster[split >= n]] = False
        target = self.merger.merge(clusters, sizes, mergeable)
        valid = np.append(self._valid(sizes.merged(target)), np.ones(total - n, np.bool_))
        of_cell = consecutive(valid)[np.append(target, np.arange(n, total))[split]]
        return replace(clusters, of_cell=of_cell, n=int(valid.sum()))

    def _connect(self, cells: Cells, points: PointColumns, count: Int) -> tuple[Int, ClusterSizes]:
        """(C,) cluster of each cell, given one point of each and (C,) its number of points; sizes of the clusters."""
        beam_m = self._beam_m(points)
        cluster = self._connect_coarse(cells, beam_m)
        extent = diagonals(points.x, points.y, cluster)
        oversized = np.flatnonzero((extent >= self.config.max_extent_m)[cluster])
        part = self._components(self.fine, cells.take(oversized), beam_m[oversized])
        cluster[oversized] = part + len(extent)
        extents = np.append(extent, diagonals(points.x[oversized], points.y[oversized], part))
        n = len(extents)
        n_points = np.bincount(cluster, count, n).astype(np.int64)
        bottom, top = label_min(cells.low, cluster, n), label_max(cells.high, cluster, n)
        one_cell = np.zeros(n, np.int64)
        one_cell[cluster] = np.arange(len(cells))
        sqrt_range, is_part = points.sqrt_range[one_cell], np.arange(n) >= len(extent)
        return cluster, ClusterSizes(n_points, extents, bottom, top, sqrt_range, beam_m[one_cell], is_part)

    def _beam_m(self, points: PointColumns) -> Float32:
        """(C,) vertical distance of neighbouring beams at each point [m]."""
        range_m = points.sqrt_range * points.sqrt_range
        beam_m: Float32 = self.beams.step_rad(points.z / range_m) * range_m
        return beam_m

    def _connect_coarse(self, fine: Cells, beam_m: Float32) -> Int:
        """(C,) cluster of each fine cell: that of the coarse cell of which it is a quarter."""
        row, column = fine.row >> 1, fine.column >> 1
        cells, sample, coarse = occupied_cells(self.coarse, row, column, fine.low, fine.high)
        return self._components(self.coarse, cells, beam_m[sample])[coarse]

    def _components(self, grid: SqrtRangeGrid, cells: Cells, beam_m: Float32) -> Int:
        """(C,) connected component of each cell."""
        return connect(grid, cells, self.gap_m + self.gap_beams * beam_m)

    def _valid(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters of an object's size; a part of an oversized cluster must stand out from it."""
        config, c = self.config, self.config.clusters
        valid: Bool = (sizes.points >= config.min_points) & (sizes.extent_m < config.max_extent_m)
        valid &= sizes.top_m - sizes.bottom_m >= config.min_height_m
        valid &= ~sizes.is_part | ((sizes.top_m >= c.min_part_top_m) & (sizes.points >= c.min_part_points))
        return valid
