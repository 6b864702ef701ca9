"""The segmentation stage."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView, upright_boxes
from modt.segmentation.box_fitting import fit_headings
from modt.segmentation.clustering import Clusterer
from modt.segmentation.clusters import Clusters
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.groups import Groups
from modt.segmentation.point_columns import PointColumns
from modt.segmentation.reflectance_statistics import has_reflectance, reflectance_statistics
from modt.segmentation.sensor_height import HeightEstimator
from modt.types import NONE, Bool, Float32, Int, Proposals


class Segmenter:
    """Sweeps to proposals (section III-A).

    Args:
        config: of the stage.
        sensor: mount, range and resolution.
        fov: part of space to segment.
    """

    def __init__(self, config: SegmentationConfig, sensor: SensorConfig, fov: FieldOfView) -> None:
        self.config, self.sensor, self.fov = config, sensor, fov
        self.margin_m = config.view_margin.margin_m
        self.truncated_m = config.view_margin.truncation_m - self.margin_m
        self.min_sqrt_range = np.float32(np.sqrt(sensor.min_range_m))
        self.max_sqrt_range = np.float32(np.sqrt(sensor.max_range_m))
        self.height_estimator = HeightEstimator(sensor, config)
        self.ground = GroundEstimator(sensor, config)
        self.clusterer = Clusterer(sensor, config)

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points; none in an empty sweep."""
        region = None if self.fov.full else np.flatnonzero(self.fov.depth(points) > -self.margin_m)
        sweep = PointColumns.from_array(points if region is None else points[region])
        sensor_height_m = self.sensor_height_m(sweep)
        height = self.ground.height_above(sweep, sensor_height_m)
        rows = np.flatnonzero(self.above_ground(sweep, height))
        if not len(rows):
            return Proposals.empty()
        index = rows if region is None else region[rows]
        measured = self.sensor.reflectance != "none" and has_reflectance(points[:, 3])
        reflectance = points[index, 3] if measured else None
        return self._proposals(sweep.take(rows), height[rows], index, reflectance)

    def sensor_height_m(self, sweep: PointColumns) -> float:
        """Height of the sensor [m]: of the profile, or estimated where the profile has none."""
        known = self.sensor.height_m
        return self.height_estimator.height_m(sweep) if known is None else known

    def above_ground(self, sweep: PointColumns, height: Float32) -> Bool:
        """(N,) points within range, and between `clearance_m` and `max_height_m` above ground."""
        mask: Bool = (height > self.config.clearance_m) & (height < self.config.max_height_m)
        mask &= (sweep.sqrt_range > self.min_sqrt_range) & (sweep.sqrt_range < self.max_sqrt_range)
        return mask

    def _proposals(self, points: PointColumns, height: Float32, index: Int, reflectance: Float32 | None) -> Proposals:
        """Clusters of the points above ground, with their boxes."""
        clusters = self.clusterer.cluster(points, height)
        cells = points.take(clusters.sample)
        depth = None if self.fov.full else self.fov.depth(cells.xyz())
        if depth is not None:
            clusters = clusters.select(self._in_view(clusters, depth))
        if not clusters.n:
            return Proposals.empty()
        by_cell = Groups.from_labels(clusters.of_cell, clusters.n)
        few = by_cell.subsample(self.config.boxes.max_cells)
        yaw = fit_headings(cells.x[few.rows], cells.y[few.rows], few, self.config.boxes.noise_m)
        groups = Groups.from_labels(clusters.of_cell.take(clusters.cell), clusters.n)
        own = np.stack([column.take(groups.rows) for column in (points.x, points.y, points.z)])
        ground_z = own[2] - height.take(groups.rows)
        truncated, statistics, offsets = np.zeros(clusters.n, np.bool_), None, groups.offsets
        if depth is not None:
            truncated = by_cell.min(depth[by_cell.rows]) < self.truncated_m
        if reflectance is not None:
            statistics = reflectance_statistics(reflectance.take(groups.rows), offsets)
        return Proposals(
            members=index.take(groups.rows),
            offsets=offsets,
            coordinates=own,
            centroid=np.stack([groups.mean(v) for v in own], axis=1),
            box=upright_boxes(own, offsets, yaw),
            truncated=truncated,
            ground_z_m=groups.mean(ground_z),
            reflectance=statistics,
        )

    def _in_view(self, clusters: Clusters, depth: Float32) -> Bool:
        """(n,) clusters in the field of view or close to it, given the (C,) depth of each cell in it [m]."""
        seen = (depth > -self.config.view_margin.object_m) & (clusters.of_cell != NONE)
        return np.bincount(clusters.of_cell[seen], minlength=clusters.n) > 0
