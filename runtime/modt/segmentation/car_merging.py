"""Merging of the strips in which few beams show a car: a rear and, a metre behind it, a strip of roof.

From above there is a gap between them; from the sensor, one begins where the other ends.
"""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clusters import Clusters, ClusterSizes
from modt.segmentation.groups import Groups, consecutive
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.view_bounds import DIRECTION, ELEVATION, HEIGHT, RANGE, ViewBounds
from modt.types import Bool, Float32, Int


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
        self.config = c = config.car_merging
        self.beams = sensor.beams
        self.max_diagonal_m = min(c.max_diagonal_m, config.max_extent_m)

    def merge(self, clusters: Clusters, sizes: ClusterSizes, mergeable: Bool) -> Int:
        """(G,) cluster into which each is merged, itself where it is not; only the (G,) mergeable ones are."""
        target, candidate = np.arange(clusters.n), mergeable & self.candidates(sizes)
        rows = np.flatnonzero(candidate)
        if len(rows):
            groups = self.kernels.group(consecutive(candidate).take(clusters.of_cell), len(rows))
            points, low, high = clusters.sampled.take(groups.rows), clusters.cells.low, clusters.cells.high
            ground = points.z - clusters.height.take(clusters.sample.take(groups.rows))
            bounds = ViewBounds.of_cells(points, ground, low.take(groups.rows), high.take(groups.rows), groups)
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
        self_index = np.arange(len(bounds))
        representative = self_index.copy()
        front, back = self.pairs(bounds)
        if len(front):
            _propagate_min(representative, front, back)
            car_id = (np.cumsum(representative == self_index) - 1)[representative]
            cars = bounds.union(Groups.from_labels(car_id, int(car_id.max()) + 1))
            representative = np.where(self.fits(cars)[car_id], representative, self_index)
        return representative

    def pairs(self, bounds: ViewBounds) -> tuple[Int, Int]:
        """Nearer and farther cluster of each pair of strips of one car."""
        c = self.config
        one, other = _overlapping(bounds.min[DIRECTION], bounds.max[DIRECTION])
        near = bounds.min[RANGE]
        swap = near[other] < near[one]
        front, back = np.where(swap, other, one), np.where(swap, one, other)
        foot = bounds.min[ELEVATION][back]
        beams = (foot - bounds.max[ELEVATION][front]) / self.beams.step_rad(foot)
        adjacent = near[back] - bounds.max[RANGE][front] < c.max_gap_m
        adjacent &= (beams > c.min_gap_beams) & (beams < c.max_gap_beams)
        person = self.person_like(bounds)
        adjacent &= ~(person[front] | person[back])
        front, back = front[adjacent], back[adjacent]
        a, b = bounds.take(front), bounds.take(back)
        both = ViewBounds(np.minimum(a.min, b.min), np.maximum(a.max, b.max), a.scale_m)
        car = self.fits(both) & (both.width_m > c.min_width_m)
        car &= (both.max[HEIGHT] > c.min_top_m) & (both.min[HEIGHT] < c.max_bottom_m)
        return front[car], back[car]

    def person_like(self, bounds: ViewBounds) -> Bool:
        """(G,) may be a person."""
        c, top = self.config, bounds.max[HEIGHT]
        person: Bool = bounds.width_m < c.max_person_width_m
        person &= (top > c.min_person_top_m) & (top - bounds.min[HEIGHT] > c.min_person_height_m)
        return person

    def fits(self, bounds: ViewBounds) -> Bool:
        """(G,) no larger than a car."""
        c = self.config
        fits: Bool = (bounds.diagonal_m < self.max_diagonal_m) & (bounds.width_m < c.max_width_m)
        fits &= bounds.max[HEIGHT] < c.max_top_m
        return fits


def _propagate_min(label: Int, one: Int, other: Int) -> None:
    """Give all entries that pairs connect the least of their labels, in place; there are few pairs."""
    while True:
        least = np.minimum(label[one], label[other])
        if (label[one] == least).all() and (label[other] == least).all():
            return
        np.minimum.at(label, one, least)
        np.minimum.at(label, other, least)


def _overlapping(start: Float32, end: Float32) -> tuple[Int, Int]:
    """Pairs of overlapping intervals, each once."""
    order = np.argsort(start, kind="stable")
    following = np.searchsorted(start[order], end[order], side="right") - np.arange(1, len(order) + 1)
    one = np.repeat(np.arange(len(order)), following)
    rank = np.arange(len(one)) - np.repeat(np.cumsum(following) - following, following)
    return order[one], order[one + 1 + rank]
