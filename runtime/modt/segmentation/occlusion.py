"""Clusters cut by a nearer object in front of them."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig
from modt.segmentation.grids import pseudo_angle
from modt.segmentation.groups import Groups
from modt.types import Bool, Float32, Float64, Int

BINS = 1024
"""Direction bins around the sensor, a power of two: 0.35 degrees each."""
UNSEEN_M = 1e4
"""Range of an empty bin, beyond every sensor's."""


class NoOcclusion:
    """Nothing is occluded."""

    def occluded(self, x: Float32, y: Float32, top_m: Float32, groups: Groups) -> Bool:
        """(G,) all False."""
        return np.zeros(len(groups), np.bool_)


class EdgeOcclusion:
    """A cluster is occluded if something tall and nearer lies directly beyond one of its edges in azimuth.

    Args:
        config: the keys of `occlusion`.
    """

    def __init__(self, config: SegmentationConfig) -> None:
        self.config = config.occlusion

    def occluded(self, x: Float32, y: Float32, top_m: Float32, groups: Groups) -> Bool:
        """(G,) mask, given (C,) positions x, y and heights above ground [m], and the rows of each cluster."""
        direction = (pseudo_angle(x, y) * np.float32(BINS / 4)).astype(np.int64) & (BINS - 1)
        range_m = np.sqrt(x * x + y * y)
        nearest = np.full(BINS, UNSEEN_M, np.float32)
        np.minimum.at(nearest, direction, np.where(top_m > self.config.min_top_m, range_m, np.float32(UNSEEN_M)))
        own, first = direction[groups.rows], direction[groups.rows[groups.offsets[:-1]]]
        turned = (own - groups.broadcast(first) + BINS // 2) & (BINS - 1)  # no cluster crosses the seam
        depth = range_m[groups.rows].astype(np.float64) / UNSEEN_M
        right = groups.min(turned + depth)
        left = groups.max(turned + 1 - depth)
        return self._nearer(nearest, first, right, -1) | self._nearer(nearest, first, left, 1)

    def _nearer(self, nearest: Float32, first: Int, edge: Float64, side: int) -> Bool:
        """(G,) something nearer lies beyond an edge, given as its bin plus a fraction for its range."""
        direction = np.floor(edge).astype(np.int64)
        fraction = edge - direction
        range_m = (fraction if side < 0 else 1 - fraction) * UNSEEN_M
        beyond = direction[:, None] + side * np.arange(1, self.config.bins + 1) + first[:, None] - BINS // 2
        nearer: Bool = (nearest[beyond & (BINS - 1)] < range_m[:, None] - self.config.min_gap_m).any(axis=1)
        return nearer


Occlusion = EdgeOcclusion | NoOcclusion
