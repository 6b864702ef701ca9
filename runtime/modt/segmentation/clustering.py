"""Euclidean clustering (section III-A) on a bird's-eye grid whose spacing grows with range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.class_sizes import SPLIT_PERSON
from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clusters import Cells, Clusters, ClusterSizes
from modt.segmentation.grids import PointColumns, SqrtRangeGrid
from modt.segmentation.groups import consecutive
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.strips import ELEVATION, MAX_BEAMS, MIN_POINTS, VISIBLE_M, CarLimits, ViewBounds
from modt.types import NONE, Bool, Float32, Int

MAX_GAP_M, MAX_GAP_BEAMS = 0.3, 2.0
"""Neighbouring cells with a vertical gap below the sum, the beams taken at their range, are one cluster."""
MIN_LINE_POINTS, MIN_LINE_TOP_M = 15, 0.5
"""A cluster lower than `min_height_m` is kept from so many points and such a top on: one beam meets an object."""
MIN_PART_POINTS, MIN_PART_TOP_M = 15, 0.9
"""The same for a part of an oversized cluster."""
MIN_SPLIT_M, MIN_CELL_RETURNS = 0.8, 0.9
"""A cluster of this extent may hold a person and more, where a fine cell is as wide as so many spacings of points."""
MIN_PERSON_POINTS = 8
"""Least number of points of a person that is split off."""


class StripMerger:
    """Merges the strips in which few beams show a car: a rear and, a metre behind it, a strip of roof.

    From above there is a gap between them; from the sensor, one begins where the other ends.

    A car across the negative y axis, the seam at which pseudo-angles begin anew, is not merged.

    Args:
        sensor: beam spacing.
        max_extent_m: longest side of a proposal.
        kernels: passes over cells.
    """

    def __init__(self, sensor: SensorConfig, max_extent_m: float, kernels: Kernels = NUMPY) -> None:
        self.kernels = kernels
        self.limits = CarLimits(max_diagonal_m=min(CarLimits().max_diagonal_m, max_extent_m))
        self.beams = sensor.beams

    def merge(self, clusters: Clusters, sizes: ClusterSizes, mergeable: Bool) -> Int:
        """(G,) cluster into which each is merged, itself where it is not; only the (G,) mergeable ones are."""
        target, candidate = np.arange(clusters.n), mergeable & self.candidates(sizes)
        rows = candidate.nonzero()[0]
        if len(rows):
            bounds = self.kernels.view_bounds(clusters, consecutive(candidate), len(rows))
            target[rows] = rows[self.targets(bounds)]
        return target

    def candidates(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that can be a strip of a car."""
        limits = self.limits
        candidate: Bool = (sizes.points >= MIN_POINTS) & (sizes.extent_m < limits.max_diagonal_m)
        candidate &= (sizes.top_m < limits.max_top_m) & (MAX_BEAMS * sizes.beam_m > VISIBLE_M)
        return candidate

    def targets(self, bounds: ViewBounds) -> Int:
        """(G,) first of the clusters that make one car with each, itself where it is not merged."""
        beam_rad = np.full(len(bounds), self.beams.step_rad(bounds.min[ELEVATION]), np.float32)
        return self.kernels.merge_strips(bounds, beam_rad, self.limits)


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
        step = config.cell_m / np.sqrt(10.0)
        self.config, self.beams = config, sensor.beams
        self.coarse = SqrtRangeGrid(step, sensor.max_range_m)
        self.fine = SqrtRangeGrid(step / 2, sensor.max_range_m)
        self.merger = StripMerger(sensor, config.max_extent_m, kernels)
        spacing = MIN_CELL_RETURNS * np.deg2rad(sensor.azimuth_step_deg)
        self.max_split_sqrt_range = np.float32(self.fine.step / spacing)  # a cell is as wide as step * sqrt(range)

    def cluster(self, points: PointColumns, height: Float32) -> Clusters:
        """Clusters of (K,) points, K > 0, with (K,) heights above ground [m]."""
        cells, sample, sampled, cell = self.kernels.occupied_cells(self.fine, points, height)
        cluster, sizes = self._connect(cells, sampled)
        clusters = Clusters(points, height, cell, cells, sample, sampled, cluster, len(sizes))
        target = self.merger.merge(clusters, sizes, self._valid(sizes) | ~sizes.is_part)
        valid = self._valid(sizes.merged(target))
        return replace(clusters, of_cell=consecutive(valid)[target].take(cluster), n=int(valid.sum()))

    def _connect(self, cells: Cells, points: PointColumns) -> tuple[Int, ClusterSizes]:
        """(C,) cluster of each cell, given one point of each; sizes of the clusters."""
        beam_m = self._beam_m(points)
        max_gap_m = np.float32(MAX_GAP_M) + np.float32(MAX_GAP_BEAMS) * beam_m
        cluster = self.kernels.connect_coarse(self.coarse, cells, max_gap_m)
        coarse = self._sizes(cells, points, beam_m, cluster)
        oversized = coarse.extent_m >= self.config.max_extent_m
        again = (oversized | self._may_hold_person(coarse)).take(cluster)
        part = self.kernels.connect(self.fine, cells, max_gap_m, again)
        parts = self._sizes(cells, points, beam_m, part)
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

    def _sizes(self, cells: Cells, points: PointColumns, beam_m: Float32, cluster: Int) -> ClusterSizes:
        """Sizes of the clusters of (C,) cells, NONE of them, given a point of each and the distance of beams [m]."""
        bounds = self.kernels.cluster_bounds(cells, points, cluster, int(cluster.max(initial=NONE)) + 1)
        return ClusterSizes.of_bounds(bounds, points, beam_m)

    def _may_hold_person(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that may hold a person and more, near enough for the fine grid to hold an object together."""
        may: Bool = (sizes.extent_m > MIN_SPLIT_M) & (sizes.top_m > SPLIT_PERSON.min_top_m)
        may &= (sizes.points >= 2 * MIN_PERSON_POINTS) & (sizes.sqrt_range < self.max_split_sqrt_range)
        return may

    def _may_be_person(self, sizes: ClusterSizes) -> Bool:
        """(G,) parts of a person's size."""
        return (sizes.points >= MIN_PERSON_POINTS) & SPLIT_PERSON.fits(sizes.extent_m, sizes.bottom_m, sizes.top_m)

    def _beam_m(self, points: PointColumns) -> Float32:
        """(C,) vertical distance of neighbouring beams at each point [m]."""
        range_m = points.sqrt_range * points.sqrt_range
        beam_m: Float32 = self.beams.step_rad(points.z / range_m) * range_m
        return beam_m

    def _valid(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters of an object's size; a part of an oversized cluster must stand out from it."""
        config = self.config
        valid: Bool = (sizes.points >= config.min_points) & (sizes.extent_m < config.max_extent_m)
        line = (sizes.points >= MIN_LINE_POINTS) & (sizes.top_m > MIN_LINE_TOP_M)
        valid &= line | (sizes.top_m - sizes.bottom_m >= config.min_height_m)
        valid &= ~sizes.is_part | ((sizes.top_m >= MIN_PART_TOP_M) & (sizes.points >= MIN_PART_POINTS))
        return valid
