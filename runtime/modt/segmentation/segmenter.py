"""The segmentation stage."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.boxes import minimum_boxes
from modt.segmentation.clusters import connected
from modt.segmentation.ground import height_above_ground
from modt.types import Float32, Proposals

EDGE_M = 0.3
"""A proposal this near the edge of the field of view counts as cut by it."""


class Segmenter:
    """Turns a sweep into proposals (section III-A).

    Args:
        config: its parameters.
        sensor: where the sensor is and how far it looks.
        fov: the part of space to look at.
    """

    def __init__(self, config: SegmentationConfig, sensor: SensorConfig, fov: FieldOfView) -> None:
        self.config, self.sensor, self.fov = config, sensor, fov

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points; none for an empty sweep."""
        near, far = self.sensor.min_range_m, self.sensor.max_range_m
        rho2 = points[:, 0] ** 2 + points[:, 1] ** 2
        visible = np.flatnonzero((rho2 > near * near) & (rho2 < far * far) & self.fov.contains(points))
        if not len(visible):
            return Proposals.empty()
        height = height_above_ground(points[visible], self.sensor, self.config)
        raised = visible[(height > self.config.ground_tolerance_m) & (height < self.config.max_height_m)]
        if not len(raised):
            return Proposals.empty()
        cluster, n = connected(points[raised, :2], self.config.cell_m, far + 1.0)
        return self._proposals(points, raised, cluster, n)

    def _proposals(self, points: Float32, raised: np.ndarray, cluster: np.ndarray, n: int) -> Proposals:
        """Drop what is too small or too large to be an object, and box the rest."""
        keep = np.bincount(cluster, minlength=n) >= self.config.min_points
        order = np.argsort(cluster, kind="stable")
        order = order[keep[cluster[order]]]
        if not len(order):
            return Proposals.empty()
        members, cluster = raised[order], cluster[order]
        starts = np.flatnonzero(np.diff(cluster, prepend=-1))
        offsets = np.append(starts, len(cluster))
        xyz = points[members, :3]
        box = minimum_boxes(xyz, offsets)
        proper = (box[:, 3] <= self.config.max_extent_m) & (box[:, 5] >= self.config.min_height_m)
        inside = np.repeat(proper, np.diff(offsets))
        members, xyz, box = members[inside], xyz[inside], box[proper]
        if not len(box):
            return Proposals.empty()
        offsets = np.append(0, np.cumsum(np.diff(offsets)[proper]))
        centroid = np.add.reduceat(xyz, offsets[:-1], axis=0, dtype=np.float64) / np.diff(offsets)[:, None]
        edge = np.minimum.reduceat(self.fov.depth(xyz), offsets[:-1]) < EDGE_M
        return Proposals(members, offsets, centroid, box, edge, np.zeros(len(box), np.bool_))
