"""The segmentation stage."""

from __future__ import annotations

import math

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.ceiling import CeilingFinder
from modt.segmentation.clustering import Clusterer
from modt.segmentation.clusters import Clusters, Members
from modt.segmentation.gaps import gaps_of
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.groups import HEADINGS, has_reflectance
from modt.segmentation.kernels import NUMPY, Above, Bounds, Kernels
from modt.segmentation.low import LowFinder
from modt.segmentation.sensor_height import HeightEstimator
from modt.segmentation.support import support_z_m
from modt.segmentation.tuning import SegmentationTuning
from modt.segmentation.view_ends import ViewEnds
from modt.types import NONE, Bool, Cut, Float32, Float64, Int, Int8, PointKind, Proposals


class Segmenter:
    """Sweeps to proposals (section III-A).

    Args:
        config: configuration of the stage.
        sensor: mount, range and resolution.
        fov: part of space to segment.
        kernels: passes over points, cells and groups.
        tuning: values of the stage that no profile sets.
    """

    def __init__(
        self,
        config: SegmentationConfig,
        sensor: SensorConfig,
        fov: FieldOfView,
        kernels: Kernels = NUMPY,
        tuning: SegmentationTuning = SegmentationTuning(),
    ) -> None:
        self.sensor = sensor
        self.fov = fov
        self.kernels = kernels
        self.tuning = tuning
        range_m = sensor.min_range_m, sensor.max_range_m
        self.bounds = Bounds(config.clearance_m, config.max_height_m, *map(math.sqrt, range_m))
        self.height_estimator = HeightEstimator(sensor, tuning.sensor_height, tuning.polar)
        self._max_slope_deg = config.max_slope_deg
        self._dead_deg: tuple[float, ...] = ()
        self.ground = GroundEstimator(sensor, config.max_slope_deg, tuning.ground, tuning.polar)
        self.ceiling = CeilingFinder(self.ground, config.max_height_m, kernels, tuning.ceiling)
        self.clusterer = Clusterer(sensor, config, kernels, tuning)
        self.low = LowFinder(sensor, config, kernels, tuning.low)
        self.ends = ViewEnds(sensor, tuning.split.person.max_top_m, tuning.view_ends)

    def facts(self) -> dict[str, str]:
        """Name of the kernels."""
        return {"kernels": self.kernels.name}

    def leave_out(self, dead_deg: tuple[float, ...]) -> None:
        """Take the beams of these elevations for dead, and all others for alive; the sweeps are not tilted."""
        if dead_deg == self._dead_deg:
            return
        self._dead_deg = dead_deg
        gaps = gaps_of(self.sensor.beam_elevations_deg, dead_deg)
        self.ground = GroundEstimator(self.sensor, self._max_slope_deg, self.tuning.ground, self.tuning.polar, gaps)
        self.clusterer.gaps = gaps

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points; none in an empty sweep."""
        self.clusterer.porosity.rays.update(points)
        above = self._above_ground_in_view(points)
        if not len(above.rows):
            return Proposals.empty(above.kind)
        cells = self.clusterer.occupied_cells(*above.tall)
        is_air = self.clusterer.airborne_points(cells)
        if is_air is not None:
            above = self.kernels.without(above, is_air)
            cells = self.clusterer.occupied_cells(*above.tall)
        tall = self.clusterer.cluster(cells, PointKind.SPARSE if is_air is None else PointKind.AIRBORNE)
        tall = self._seen(tall)
        low, places, feet = self.low.find(above, tall)
        low = self._seen(low)
        members = self.kernels.members_of(tall, low, places, above.points, above.height_m, above.rows, above.kind)
        return self._proposals(points, [tall, low], members, above.kind, above.rows.take(feet)).lock()

    def _proposals(
        self, points: Float32, parts: list[Clusters], members: Members, kind: Int8, feet: Int
    ) -> Proposals:
        """Proposals of clusters with these members, given the kinds of all points and the feet in the sweep."""
        heading = np.concatenate([self._headings(clusters) for clusters in parts])
        box = self.kernels.upright_boxes(members.columns[:3], members.offsets, heading)
        cut = self.ends.cut(members.columns[:3], members.offsets, box)
        if not self.fov.full:
            cut |= Cut.SIDE * np.concatenate([self._reach_end_of_margin(clusters) for clusters in parts])
        count = np.diff(members.offsets)
        mean = self.kernels.group_sums(members.columns, members.offsets) / count
        return Proposals(
            members=members.index,
            offsets=members.offsets,
            coordinates=members.columns[:3],
            centroid=np.ascontiguousarray(mean[:3].T),
            box=box,
            cut=cut,
            ground_z_m=support_z_m(mean[3], box, count, self.tuning.support),
            reflectance=self._reflectance(points, members),
            kind=kind,
            feet=feet,
        )

    def sensor_height_m(self, points: Float32) -> float:
        """Height of the sensor [m]: of the profile, or estimated where the profile has none."""
        known = self.sensor.height_m
        return self.height_estimator.height_m(points) if known is None else known

    def above_ground(self, points: Float32) -> Above:
        """Those of (N, 4) points within range, and `clearance_m` to `max_height_m` or the ceiling above ground."""
        sensor_height_m = self.sensor_height_m(points)
        above = self.kernels.above_ground(self.ground, points, sensor_height_m, self.bounds)
        overhead = self.ceiling.overhead(points, above, sensor_height_m)
        if overhead is None:
            return above
        above.kind[above.rows[overhead]] = PointKind.OVERHEAD
        kept = np.flatnonzero(~overhead)
        rows = above.rows.take(kept)
        return above._replace(rows=rows, points=above.points.take(kept), height_m=above.height_m.take(kept))

    def _above_ground_in_view(self, points: Float32) -> Above:
        """`above_ground`, restricted to the view and its margin."""
        if self.fov.full:
            return self.above_ground(points)
        region = np.flatnonzero(self.fov.depth(points) > -self.tuning.view.margin_m)
        above = self.above_ground(points[region])
        kind = np.full(len(points), PointKind.OUT_OF_VIEW, np.int8)
        kind[region] = above.kind
        return above._replace(rows=region[above.rows], kind=kind)

    def _seen(self, clusters: Clusters) -> Clusters:
        """The clusters in the field of view or close to it."""
        if self.fov.full:
            return clusters
        seen = self.fov.depth(clusters.sampled.xyz()) > -self.tuning.view.in_view_m
        seen &= clusters.cluster_of_cell != NONE
        is_seen = np.bincount(clusters.cluster_of_cell[seen], minlength=clusters.n) > 0
        return clusters.select(is_seen, PointKind.OUT_OF_VIEW)

    def _headings(self, clusters: Clusters) -> Float64:
        """(n,) heading of the box that suits the cells of each cluster [rad]."""
        tuning = self.tuning.heading
        cells_of_cluster = self.kernels.group(clusters.cluster_of_cell, clusters.n)
        x = clusters.sampled.x
        y = clusters.sampled.y
        best = self.kernels.best_headings(x, y, cells_of_cluster, tuning.max_cells, tuning.side_noise_m)
        headings: Float64 = HEADINGS[best]
        return headings

    def _reach_end_of_margin(self, clusters: Clusters) -> Bool:
        """(n,) clusters that the margin of the field of view cuts."""
        view = self.tuning.view
        depth = self.fov.depth(clusters.sampled.xyz())
        cells_of_cluster = self.kernels.group(clusters.cluster_of_cell, clusters.n)
        deepest: Bool = cells_of_cluster.min(depth[cells_of_cluster.rows]) < view.truncation_m - view.margin_m
        return deepest

    def _reflectance(self, points: Float32, members: Members) -> Float64 | None:
        """(n, 5) statistics of reflectance of the members, None where the sweep has none or of an unknown scale."""
        if self.sensor.reflectance == "none" or not has_reflectance(points[:, 3]):
            return None
        return self.kernels.reflectance_statistics(points, members.index, members.offsets)
