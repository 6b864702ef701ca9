"""The segmentation stage."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.boxes import headings, upright_boxes
from modt.segmentation.clusters import RootGrid
from modt.segmentation.columns import Columns
from modt.segmentation.ground import Ground
from modt.segmentation.groups import Groups
from modt.types import NONE, Bool, Float32, Int, Proposals

MARGIN_M = 6.0
"""Looked at beyond the edge of the field of view, so that what stands on the edge is segmented whole."""

EDGE_M = 0.3
"""A proposal this near the end of the margin counts as cut by it."""


class Segmenter:
    """Turns a sweep into proposals (section III-A).

    Args:
        config: its parameters.
        sensor: where the sensor is and how far it looks.
        fov: the part of space to look at.
    """

    def __init__(self, config: SegmentationConfig, sensor: SensorConfig, fov: FieldOfView) -> None:
        self.config, self.sensor, self.fov = config, sensor, fov
        self.ground = Ground(sensor, config)
        self.grid = RootGrid(config.cell_m, sensor.max_range_m)

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points; none for an empty sweep."""
        looked_at = None if self.fov.full else np.flatnonzero(self.fov.depth(points) > -MARGIN_M)
        sweep = Columns.of(points if looked_at is None else points[looked_at])
        raised = np.flatnonzero(self._raised(sweep))
        if not len(raised):
            return Proposals.empty()
        index = raised if looked_at is None else looked_at[raised]
        return self._proposals(sweep.take(raised), index)

    def _raised(self, sweep: Columns) -> Bool:
        """(N,) within range, above the ground and no higher than objects reach."""
        height = self.ground.height(sweep, self.sensor.height_m or 1.73)
        near, far = np.float32(np.sqrt(self.sensor.min_range_m)), np.float32(np.sqrt(self.sensor.max_range_m))
        inside = (sweep.root > near) & (sweep.root < far)
        raised: Bool = inside & (height > self.config.ground_tolerance_m) & (height < self.config.max_height_m)
        return raised

    def _proposals(self, raised: Columns, index: Int) -> Proposals:
        """The clusters of what is raised that could be objects, and their boxes."""
        cells = self.grid.cells(raised)
        x, y, z = (v[cells.sample] for v in (raised.x, raised.y, raised.z))
        in_view = self.fov.contains(np.stack([x, y, z], axis=1))
        cluster = self._proper(self.grid.join(cells), np.bincount(cells.of_point), x, y, in_view)
        n = int(cluster.max(initial=NONE)) + 1
        if not n:
            return Proposals.empty()
        corners = Groups.of(cluster, n)
        yaw = headings(x[corners.rows], y[corners.rows], corners)
        groups = Groups.of(cluster[cells.of_point], n)
        own = raised.take(groups.rows)
        box = upright_boxes(own.x, own.y, own.z, groups, yaw)
        centroid = np.stack([groups.mean(v) for v in (own.x, own.y, own.z)], axis=1)
        truncated = groups.least(self.fov.depth(np.stack([own.x, own.y, own.z], axis=1))) < EDGE_M - MARGIN_M
        return Proposals(index[groups.rows], groups.offsets, centroid, box, truncated, np.zeros(n, np.bool_))

    def _proper(self, cluster: Int, count: Int, x: Float32, y: Float32, in_view: Bool) -> Int:
        """(C,) cluster of each cell anew, numbered without gaps; NONE if of improper size or all out of view."""
        n = int(cluster.max()) + 1
        proper = np.bincount(cluster, count, n) >= self.config.min_points
        extent = [_extent(v, cluster, n) for v in (x, y)]
        proper &= np.hypot(*extent) < self.config.max_extent_m
        proper &= np.bincount(cluster, in_view, n) > 0
        number = np.where(proper, np.cumsum(proper) - 1, NONE)
        return number[cluster]


def _extent(values: Float32, group: Int, n: int) -> Float32:
    low, high = np.full(n, np.inf, np.float32), np.full(n, -np.inf, np.float32)
    np.minimum.at(low, group, values)
    np.maximum.at(high, group, values)
    return high - low
