"""The segmentation stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.box_fitting import headings, upright_boxes
from modt.segmentation.clusters import Clusterer, Clusters
from modt.segmentation.columns import Columns
from modt.segmentation.ground import Ground
from modt.segmentation.groups import Groups
from modt.segmentation.occlusion import occluded
from modt.segmentation.reflectance_statistics import brightness, recorded
from modt.segmentation.sensor_height import sensor_height
from modt.types import NONE, Bool, Float32, Int, Proposals

MARGIN_M = 6.0
"""Looked at beyond the edge of the field of view, so that what stands on the edge is segmented whole."""
SLACK_M = 1.0
"""Of an object that lies in view the sensor may see only what is this far out of it."""
EDGE_M = 0.3
"""A proposal this near the end of the margin counts as cut by it."""
OCCLUDER_M = 0.6
"""What rises this high above ground hides what is behind it."""
OUTLINE = 32
"""Cells of a cluster, at most, that decide on its heading."""


class Segmenter:
    """Turns a sweep into proposals (section III-A).

    Args:
        config: its parameters.
        sensor: where the sensor is and how far it looks.
        fov: the part of space to look at.
    """

    def __init__(self, config: SegmentationConfig, sensor: SensorConfig, fov: FieldOfView) -> None:
        self.config, self.sensor, self.fov = config, sensor, fov
        self.sensor_height = sensor_height(sensor)
        self.ground = Ground(sensor, config)
        self.clusterer = Clusterer(sensor, config)
        _keep_freed_pages()

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points; none for an empty sweep."""
        looked_at = None if self.fov.full else np.flatnonzero(self.fov.depth(points) > -MARGIN_M)
        sweep = Columns.of(points if looked_at is None else points[looked_at])
        above = self.sensor_height.of(sweep)
        height = self.ground.height(sweep, above)
        raised = np.flatnonzero(self.raised(sweep, height))
        if not len(raised):
            return Proposals.empty()
        index = raised if looked_at is None else looked_at[raised]
        seen = self.sensor.reflectance != "none" and recorded(points[:, 3])
        reflectance = points[index, 3] if seen else None
        proposals = self._proposals(sweep.take(raised), height[raised], index, reflectance)
        return replace(proposals, sensor_height_m=above)

    def raised(self, sweep: Columns, height: Float32) -> Bool:
        """(N,) within range, clear of the ground and no higher than objects reach."""
        near, far = np.float32(np.sqrt(self.sensor.min_range_m)), np.float32(np.sqrt(self.sensor.max_range_m))
        raised: Bool = (height > self.config.clearance_m) & (height < self.config.max_height_m)
        raised &= (sweep.root > near) & (sweep.root < far)
        return raised

    def _proposals(self, raised: Columns, height: Float32, index: Int, reflectance: Float32 | None) -> Proposals:
        """The clusters of what is raised, and their boxes."""
        clusters = self.clusterer.cluster(raised, height)
        cell = raised.take(clusters.sample)
        if not self.fov.full:
            clusters = clusters.kept(self._in_view(clusters, cell))
        if not clusters.n:
            return Proposals.empty()
        outline = Groups.of(clusters.of_cell, clusters.n)
        few = outline.thinned(OUTLINE)
        yaw = headings(cell.x[few.rows], cell.y[few.rows], few)
        groups = Groups.of(clusters.of_cell.take(clusters.cell), clusters.n)
        own = np.stack([column.take(groups.rows) for column in (raised.x, raised.y, raised.z)])
        x, y, z = own
        box = upright_boxes(x, y, z, groups, yaw)
        centroid = np.stack([groups.mean(v) for v in own], axis=1)
        truncated = np.zeros(clusters.n, np.bool_)
        if not self.fov.full:
            truncated = outline.least(self.fov.depth(cell.xyz())[outline.rows]) < EDGE_M - MARGIN_M
        hidden = occluded(cell.x, cell.y, clusters.top > OCCLUDER_M, outline)
        told = None if reflectance is None else brightness(reflectance.take(groups.rows), groups.offsets)
        members = index.take(groups.rows)
        return Proposals(members, groups.offsets, own, centroid, box, truncated, hidden, reflectance=told)

    def _in_view(self, clusters: Clusters, cell: Columns) -> Bool:
        """(n,) whether a cluster reaches into the field of view, or nearly."""
        seen = (self.fov.depth(cell.xyz()) > -SLACK_M) & (clusters.of_cell != NONE)
        return np.bincount(clusters.of_cell[seen], minlength=clusters.n) > 0


def _keep_freed_pages() -> None:
    """Let the C library keep the memory of one sweep for the next.

    glibc hands large blocks back to the kernel as they are freed, and every sweep then pays for fresh pages: a third
    of the stage's time. Having once freed a block of nearly 32 MB (never touched, so it costs nothing), it stops.
    """
    np.empty(31 << 20, np.uint8)
