"""Merging of the strips in which few beams show a car: a rear and, a metre behind it, a strip of roof.

From above there is a gap between them; from the sensor, one begins where the other ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clusters import Clusters, ClusterSizes
from modt.segmentation.groups import consecutive
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.view_bounds import ELEVATION, ViewBounds
from modt.types import Bool, Int


class StripMerger:
    """Merges the strips of one car.

    A car across the negative y axis, the seam at which pseudo-angles begin anew, is not merged.

    Args:
        sensor: beam spacing.
        config: `max_extent_m` and the keys of `car_merging`.
        kernels: passes over cells.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig, kernels: Kernels = NUMPY) -> None:
        self.kernels = kernels
        diagonal_m = min(config.car_merging.max_diagonal_m, config.max_extent_m)
        self.config = replace(config.car_merging, max_diagonal_m=diagonal_m)
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
        c = self.config
        candidate: Bool = (sizes.points >= c.min_points) & (sizes.extent_m < c.max_diagonal_m)
        candidate &= (sizes.top_m < c.max_top_m) & (c.max_beams * sizes.beam_m > c.visible_m)
        return candidate

    def targets(self, bounds: ViewBounds) -> Int:
        """(G,) first of the clusters that make one car with each, itself where it is not merged."""
        beam_rad = np.full(len(bounds), self.beams.step_rad(bounds.min[ELEVATION]), np.float32)
        return self.kernels.merge_strips(bounds, beam_rad, self.config)
