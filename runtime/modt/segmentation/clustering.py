"""Euclidean clustering (section III-A) on a bird's-eye grid whose spacing grows with range."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.cell_clusterer import CellClusterer
from modt.segmentation.cells import Cells
from modt.segmentation.cluster_sizes import ClusterSizes, moved
from modt.segmentation.clusters import Clusters
from modt.segmentation.gaps import NO_GAPS, unseen_m
from modt.segmentation.grids import PointColumns
from modt.segmentation.groups import consecutive, label_max
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.porosity import PorosityFinder
from modt.segmentation.set_apart import set_apart
from modt.segmentation.strips import ELEVATION
from modt.segmentation.tuning import SegmentationTuning
from modt.types import NONE, Bool, Float32, Int, Int8, PointKind


class Clusterer:
    """Clusters of points that can be objects.

    A coarse grid connects objects with sparse returns. Clusters that it may have joined wrongly are clustered once
    more on a grid of half the spacing. An oversized cluster falls into its parts there. Parts that may be a person
    are split off a cluster that may hold a person and more. So are people side by side, and who pushes something.
    What stands before the long surface of a wall, a hedge or a vehicle leaves it. Of the rest, what is longer than
    any object, or a low part of an oversized cluster, is structure.

    Args:
        sensor: range and beam spacing.
        config: clustering distance and sizes of objects.
        kernels: passes over points and cells.
        tuning: connected cells, split parts, merged strips and kept clusters.
    """

    def __init__(
        self,
        sensor: SensorConfig,
        config: SegmentationConfig,
        kernels: Kernels = NUMPY,
        tuning: SegmentationTuning = SegmentationTuning(),
    ) -> None:
        self.kernels = kernels
        self.config = config
        self.beams = sensor.beams
        self.gaps = NO_GAPS  # of dead beams
        self.cells = CellClusterer(
            sensor, config, tuning.cells, tuning.split, tuning.structure, tuning.clusters, tuning.overhang
        )
        self.porosity = PorosityFinder(sensor, self.cells.fine, tuning.porosity)
        self.min_solidity = tuning.porosity.min_cluster_solidity
        self.kept = tuning.clusters
        self.heads = tuning.heads
        max_diagonal_m = min(tuning.strips.max_diagonal_m, config.max_extent_m)
        self.strips = replace(tuning.strips, max_diagonal_m=max_diagonal_m)

    def occupied_cells(self, points: PointColumns, height: Float32) -> Clusters:
        """Cells of (K,) points, K > 0, with (K,) heights above ground [m], in no cluster yet."""
        cells, sample, sampled, cell_of_point = self.kernels.occupied_cells(self.cells.fine, points, height)
        air = self.kernels.air(self.porosity, cells, sampled.sqrt_range, self._beam_m(sampled))
        cluster = np.full(len(cells), NONE)
        kind = np.zeros(len(cells), np.int8)
        return Clusters(points, height, cell_of_point, cells, sample, sampled, cluster, kind, 0, air)

    def airborne_points(self, found: Clusters) -> Bool | None:
        """(K,) airborne points, None unless the air is full."""
        return self.kernels.airborne_points(self.porosity, found) if self.porosity.is_full(found) else None

    def cluster(self, found: Clusters, kind_of_porous: PointKind = PointKind.SPARSE) -> Clusters:
        """These cells in clusters that can be objects; a cluster that most rays pass is of a kind."""
        cluster, sizes, hanging = self.kernels.cluster(self.cells, found.cells, found.sampled, found.air.beam_m)
        found, cluster, sizes = set_apart(found, cluster, sizes, hanging)
        cluster, sizes = self._people_split_off(cluster, sizes, found.cells, found.sampled, found.air.beam_m)
        found = replace(found, cluster_of_cell=cluster, n=len(sizes))
        # Strips are merged before clusters are judged, since a strip alone may be too low to be an object.
        unseen_m = self._unseen_m(found)
        is_object = self._kind(sizes, unseen_m) == PointKind.MEMBER
        strip = (is_object | ~sizes.of_oversized) & self.may_be_strips(sizes)
        target = self._merged(found, strip)
        kind = self._kind(sizes.merged(target), unseen_m)
        target_of_cell = target.take(cluster)
        is_porous = self.kernels.mean_solidity(found, target_of_cell, len(kind)) < self.min_solidity
        kind[is_porous] = kind_of_porous
        is_member = kind == PointKind.MEMBER
        return replace(
            found,
            cluster_of_cell=consecutive(is_member).take(target_of_cell),
            kind_of_cell=kind.take(target_of_cell),
            n=int(np.count_nonzero(is_member)),
        )

    def _people_split_off(
        self, cluster: Int, sizes: ClusterSizes, cells: Cells, sampled: PointColumns, beam_m: Float32
    ) -> tuple[Int, ClusterSizes]:
        """(C,) cluster of each cell and sizes, after people have left clusters of people and what they push."""
        heads = self.heads
        tried = (sizes.points >= heads.min_points) & (sizes.sqrt_range < math.sqrt(heads.max_range_m))
        tried &= (sizes.extent_m > heads.min_extent_m) & (sizes.extent_m < heads.max_extent_m)
        tried &= sizes.top_m > heads.min_top_m
        part = np.full(len(cells), NONE)
        n = 0
        for g in tried.nonzero()[0]:
            rows = (cluster == g).nonzero()[0]
            person = self.kernels.find_people(
                sampled.x[rows], sampled.y[rows], cells.low[rows], cells.high[rows], cells.entries[rows], heads
            )
            found = person != NONE
            part[rows[found]] = n + person[found]
            n += int(person.max(initial=NONE)) + 1
        if not n:
            return cluster, sizes
        parts = ClusterSizes.of_cells(cells, sampled, beam_m, part)
        return moved(cells, cluster, sizes, part, parts, np.ones(n, np.bool_))

    def _beam_m(self, points: PointColumns) -> Float32:
        """(C,) vertical distance of neighbouring beams at each point [m]."""
        range_m = points.sqrt_range * points.sqrt_range
        beam_m: Float32 = self.beams.step_rad(points.z / range_m) * range_m
        return beam_m

    def may_be_strips(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that can be a strip of a car."""
        strips = self.strips
        strip: Bool = (sizes.points >= strips.min_points) & (sizes.extent_m < strips.max_diagonal_m)
        strip &= (sizes.top_m < strips.max_top_m) & (strips.max_beams * sizes.beam_m > strips.visible_m)
        return strip

    def _merged(self, clusters: Clusters, strip: Bool) -> Int:
        """(G,) cluster into which each is merged, itself where it is not; only the (G,) strips are.

        Few beams show a rear and, a metre behind it, a strip of roof. From above there is a gap between them; from
        the sensor, one begins where the other ends. A car across the negative y axis, the seam at which pseudo-angles
        begin anew, is not merged.
        """
        target = np.arange(clusters.n)
        cluster_of_strip = strip.nonzero()[0]
        if len(cluster_of_strip):
            bounds = self.kernels.view_bounds(clusters, consecutive(strip), len(cluster_of_strip))
            beam_rad = np.full(len(bounds), self.beams.step_rad(bounds.min[ELEVATION]), np.float32)
            first_strip = self.kernels.merge_strips(bounds, beam_rad, self.strips)
            target[cluster_of_strip] = cluster_of_strip[first_strip]
        return target

    def _unseen_m(self, clusters: Clusters) -> Float32 | float:
        """(G,) height by which each cluster may be taller than what is seen, across a gap of a dead beam [m]."""
        if not len(self.gaps):
            return 0.0
        of_cell = unseen_m(self.gaps, clusters.sampled)
        return np.maximum(label_max(of_cell, clusters.cluster_of_cell, clusters.n), np.float32(0.0))

    def _kind(self, sizes: ClusterSizes, unseen_m: Float32 | float = 0.0) -> Int8:
        """(G,) PointKind: MEMBER of an object's size. A part of an oversized cluster must stand out from it.

        Oversized clusters were divided; what is left may be an object up to `max_extent_m`.
        """
        config = self.config
        endless = sizes.extent_m >= config.max_extent_m
        stands_out = (sizes.top_m >= self.kept.min_part_top_m) & (sizes.points >= self.kept.min_part_points)
        tall = sizes.top_m - sizes.bottom_m + unseen_m >= config.min_height_m
        line = (sizes.points >= self.kept.min_line_points) & (sizes.top_m > self.kept.min_line_top_m)
        kind = np.full(len(sizes), PointKind.MEMBER, np.int8)
        kind[~(tall | line)] = PointKind.LOW
        kind[sizes.points < config.min_points] = PointKind.SPARSE
        kind[endless | (sizes.of_oversized & ~stands_out)] = PointKind.STRUCTURE
        return kind
