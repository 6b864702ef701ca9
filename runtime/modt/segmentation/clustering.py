"""Euclidean clustering (section III-A) on a bird's-eye grid whose spacing grows with range."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clusters import CellClusterer, Clusters, ClusterSizes
from modt.segmentation.grids import PointColumns
from modt.segmentation.groups import consecutive
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.strips import ELEVATION, MAX_BEAMS, MIN_POINTS, VISIBLE_M, CarLimits
from modt.types import Bool, Float32, Int

MIN_LINE_POINTS, MIN_LINE_TOP_M = 15, 0.5
"""A cluster lower than `min_height_m` is kept from so many points and such a top on: one beam meets an object."""
MIN_PART_POINTS, MIN_PART_TOP_M = 15, 0.9
"""The same for a part of an oversized cluster."""


class Clusterer:
    """Clusters of points that can be objects.

    A coarse grid connects objects with sparse returns. Clusters that it may have joined wrongly are clustered once
    more on a grid of half the spacing. An oversized cluster (a wall, a hedge) keeps only the parts that stand out of
    it. Parts that may be a person are split off a cluster that may hold a person and more.

    Args:
        sensor: range and beam spacing.
        config: clustering distance and sizes of objects.
        kernels: passes over points and cells.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig, kernels: Kernels = NUMPY) -> None:
        self.kernels = kernels
        self.config, self.beams = config, sensor.beams
        self.cells = CellClusterer(sensor, config)
        self.car = CarLimits(max_diagonal_m=min(CarLimits().max_diagonal_m, config.max_extent_m))

    def cluster(self, points: PointColumns, height: Float32) -> Clusters:
        """Clusters of (K,) points, K > 0, with (K,) heights above ground [m]."""
        cells, sample, sampled, cell = self.kernels.occupied_cells(self.cells.fine, points, height)
        cluster, sizes = self.kernels.cluster(self.cells, cells, sampled, self._beam_m(sampled))
        clusters = Clusters(points, height, cell, cells, sample, sampled, cluster, len(sizes))
        strip = (self._valid(sizes) | ~sizes.is_part) & self.may_be_strips(sizes)
        target = self._merged(clusters, strip)
        valid = self._valid(sizes.merged(target))
        of_cell, n = consecutive(valid)[target].take(cluster), int(np.count_nonzero(valid))
        return Clusters(points, height, cell, cells, sample, sampled, of_cell, n)  # faster than to replace two fields

    def _beam_m(self, points: PointColumns) -> Float32:
        """(C,) vertical distance of neighbouring beams at each point [m]."""
        range_m = points.sqrt_range * points.sqrt_range
        beam_m: Float32 = self.beams.step_rad(points.z / range_m) * range_m
        return beam_m

    def may_be_strips(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that can be a strip of a car."""
        strip: Bool = (sizes.points >= MIN_POINTS) & (sizes.extent_m < self.car.max_diagonal_m)
        strip &= (sizes.top_m < self.car.max_top_m) & (MAX_BEAMS * sizes.beam_m > VISIBLE_M)
        return strip

    def _merged(self, clusters: Clusters, strip: Bool) -> Int:
        """(G,) cluster into which each is merged, itself where it is not; only the (G,) strips are.

        Few beams show a rear and, a metre behind it, a strip of roof. From above there is a gap between them; from
        the sensor, one begins where the other ends. A car across the negative y axis, the seam at which pseudo-angles
        begin anew, is not merged.
        """
        target, rows = np.arange(clusters.n), strip.nonzero()[0]
        if len(rows):
            bounds = self.kernels.view_bounds(clusters, consecutive(strip), len(rows))
            beam_rad = np.full(len(bounds), self.beams.step_rad(bounds.min[ELEVATION]), np.float32)
            target[rows] = rows[self.kernels.merge_strips(bounds, beam_rad, self.car)]
        return target

    def _valid(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters of an object's size; a part of an oversized cluster must stand out from it."""
        config = self.config
        valid: Bool = (sizes.points >= config.min_points) & (sizes.extent_m < config.max_extent_m)
        line = (sizes.points >= MIN_LINE_POINTS) & (sizes.top_m > MIN_LINE_TOP_M)
        valid &= line | (sizes.top_m - sizes.bottom_m >= config.min_height_m)
        valid &= ~sizes.is_part | ((sizes.top_m >= MIN_PART_TOP_M) & (sizes.points >= MIN_PART_POINTS))
        return valid
