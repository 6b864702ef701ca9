"""The segmentation stage."""

from __future__ import annotations

import numpy as np

from modt.class_sizes import SPLIT_PERSON
from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.ceiling import SAMPLED, below_ceiling_m, below_grazed_m
from modt.segmentation.clustering import Clusterer
from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import PointColumns
from modt.segmentation.ground import GroundEstimator, HeightEstimator
from modt.segmentation.groups import HEADINGS, has_reflectance
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.view_ends import ViewEnds
from modt.types import NONE, Bool, Cut, Float32, Int, Proposals

VIEW_MARGIN_M, IN_VIEW_M = 6.0, 1.0
"""Points this far outside a limited field of view are segmented, and proposals this far outside it are kept."""
TRUNCATION_M = 0.3
"""A proposal this near to the end of the margin is cut there."""
HEADING_CELLS, SIDE_NOISE_M = 32, 0.1
"""Cells of a proposal that decide on the heading of its box; points nearer to a side lie on it."""


class Segmenter:
    """Sweeps to proposals (section III-A).

    Args:
        config: configuration of the stage.
        sensor: mount, range and resolution.
        fov: part of space to segment.
        kernels: passes over points, cells and groups.
    """

    def __init__(
        self, config: SegmentationConfig, sensor: SensorConfig, fov: FieldOfView, kernels: Kernels = NUMPY
    ) -> None:
        self.config, self.sensor, self.fov, self.kernels = config, sensor, fov, kernels
        ranges = np.sqrt([sensor.min_range_m, sensor.max_range_m])
        self.bounds: Float32 = np.array([config.clearance_m, config.max_height_m, *ranges], np.float32)
        self.height_estimator = HeightEstimator(sensor)
        self.ground = GroundEstimator(sensor, config.max_slope_deg)
        self.clusterer = Clusterer(sensor, config, kernels)
        self.ends = ViewEnds(sensor, SPLIT_PERSON.max_top_m)

    def facts(self) -> dict[str, str]:
        """Which kernels it runs on."""
        return {"kernels": self.kernels.name}

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points; none in an empty sweep."""
        region = None if self.fov.full else np.flatnonzero(self.fov.depth(points) > -VIEW_MARGIN_M)
        rows, above, height = self.above_ground(points if region is None else points[region])
        if not len(rows):
            return Proposals.empty()
        clusters = self.clusterer.cluster(above, height)
        return self._proposals(clusters, rows if region is None else region[rows], points)

    def sensor_height_m(self, points: Float32) -> float:
        """Height of the sensor [m]: of the profile, or estimated where the profile has none."""
        known = self.sensor.height_m
        return self.height_estimator.height_m(points) if known is None else known

    def above_ground(self, points: Float32) -> tuple[Int, PointColumns, Float32]:
        """(K,) rows of the points within range, and `clearance_m` to `max_height_m` or the ceiling above ground.

        With them come those points and their (K,) heights above ground [m].
        """
        sensor_height_m = self.sensor_height_m(points)
        rows, above, height, count = self.kernels.above_ground(self.ground, points, sensor_height_m, self.bounds)
        limit_m = below_ceiling_m(count)
        if limit_m is None:
            limit_m = below_grazed_m(points[::SAMPLED, 2], sensor_height_m, self.config.max_height_m)
        if limit_m is None:
            return rows, above, height
        kept = np.flatnonzero(height < np.float32(limit_m))
        return rows.take(kept), above.take(kept), height.take(kept)

    def _proposals(self, clusters: Clusters, index: Int, sweep: Float32) -> Proposals:
        """The clusters in view with their boxes, given (K,) the row of each point in the (N, 4) sweep."""
        cells, kernels = clusters.sampled, self.kernels
        depth = None if self.fov.full else self.fov.depth(cells.xyz())
        if depth is not None:
            clusters = clusters.select(self._in_view(clusters, depth))
        if not clusters.n:
            return Proposals.empty()
        by_cell = kernels.group(clusters.of_cell, clusters.n)
        heading = kernels.best_headings(cells.x, cells.y, by_cell, HEADING_CELLS, SIDE_NOISE_M)
        members = kernels.members_of(clusters, index)
        offsets, own = members.offsets, members.columns[:3]
        mean = kernels.group_sums(members.columns, offsets) / (offsets[1:] - offsets[:-1])
        box = kernels.upright_boxes(own, offsets, HEADINGS[heading])
        cut, statistics = self.ends.cut(own, offsets, box), None
        if depth is not None:
            cut |= Cut.SIDE * (by_cell.min(depth[by_cell.rows]) < TRUNCATION_M - VIEW_MARGIN_M)
        if self.sensor.reflectance != "none" and has_reflectance(sweep[:, 3]):
            statistics = kernels.reflectance_statistics(sweep, members.index, offsets)
        return Proposals(
            members=members.index,
            offsets=offsets,
            coordinates=own,
            centroid=np.ascontiguousarray(mean[:3].T),
            box=box,
            cut=cut,
            ground_z_m=mean[3],
            reflectance=statistics,
        )

    def _in_view(self, clusters: Clusters, depth: Float32) -> Bool:
        """(n,) clusters in the field of view or close to it, given the (C,) depth of each cell in it [m]."""
        seen = (depth > -IN_VIEW_M) & (clusters.of_cell != NONE)
        return np.bincount(clusters.of_cell[seen], minlength=clusters.n) > 0
