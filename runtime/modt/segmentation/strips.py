"""Strips of one car: which of the clusters that few beams show belong together, by their bounds in the view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.class_sizes import PersonSize
from modt.config.segmentation import CarMergeConfig
from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import PointColumns, pseudo_angle
from modt.segmentation.groups import Groups
from modt.types import Bool, Float32, Int, Self

DIRECTION, RANGE, HEIGHT, ELEVATION = range(4)


@dataclass(frozen=True, slots=True)
class ViewBounds:
    """Bounds of groups of cells: direction [pseudo-angle], range [m], height above ground [m], elevation [tan]."""

    min: Float32  # (4, G)
    max: Float32  # (4, G)
    scale_m: Float32  # (G,) metres across the ray per unit of the pseudo-angle

    @classmethod
    def of_cells(cls, points: PointColumns, ground: Float32, low: Float32, high: Float32, groups: Groups) -> Self:
        """Bounds of (C,) cells in the order of their groups.

        Given are a point of each cell, the ground below it [m, sensor frame], and the bounds of its height above it.
        """
        direction, range_m = pseudo_angle(points.x, points.y), np.square(points.sqrt_range)
        scale_m = np.square(np.abs(points.x) + np.abs(points.y)) / range_m
        return cls(
            groups.min(np.stack([direction, range_m, low, (low + ground) / range_m])),
            groups.max(np.stack([direction, range_m, high, (high + ground) / range_m])),
            scale_m[groups.offsets[:-1]].astype(np.float32, copy=False),
        )

    def __len__(self) -> int:
        return len(self.scale_m)

    def take(self, rows: Int) -> Self:
        """Bounds by index."""
        return type(self)(self.min[:, rows], self.max[:, rows], self.scale_m[rows])

    def union(self, groups: Groups) -> Self:
        """Common bounds of groups of these."""
        own = self.take(groups.rows)
        return type(self)(groups.min(own.min), groups.max(own.max), own.scale_m[groups.offsets[:-1]])

    @property
    def width_m(self) -> Float32:
        """(G,) extent across the ray [m]."""
        width_m: Float32 = (self.max[DIRECTION] - self.min[DIRECTION]) * self.scale_m
        return width_m

    @property
    def diagonal_m2(self) -> Float32:
        """(G,) square of the extent across and along the ray [m2]."""
        diagonal_m2: Float32 = np.square(self.width_m) + np.square(self.max[RANGE] - self.min[RANGE])
        return diagonal_m2


def view_bounds(clusters: Clusters, number: Int, n: int) -> ViewBounds:
    """Bounds of n clusters in the view, given (G,) the number of each, or NONE."""
    groups = Groups.from_labels(number.take(clusters.of_cell), n)
    points, cells = clusters.sampled.take(groups.rows), clusters.cells
    ground = points.z - clusters.height.take(clusters.sample.take(groups.rows))
    return ViewBounds.of_cells(points, ground, cells.low.take(groups.rows), cells.high.take(groups.rows), groups)


def merge_strips(bounds: ViewBounds, beam_rad: Float32, config: CarMergeConfig) -> Int:
    """(G,) first of the clusters that make one car with each, itself where it is not merged.

    Args:
        bounds: of the clusters.
        beam_rad: (G,) spacing of the beams at the foot of each [rad].
        config: limits.
    """
    self_index = np.arange(len(bounds))
    representative = self_index.copy()
    front, back = pairs(bounds, beam_rad, config)
    if len(front):
        _propagate_min(representative, front, back)
        car_id = (np.cumsum(representative == self_index) - 1)[representative]
        cars = bounds.union(Groups.from_labels(car_id, int(car_id.max()) + 1))
        representative = np.where(fits(cars, config)[car_id], representative, self_index)
    return representative


def pairs(bounds: ViewBounds, beam_rad: Float32, config: CarMergeConfig) -> tuple[Int, Int]:
    """Nearer and farther cluster of each pair of strips of one car."""
    c = config
    one, other = _overlapping(bounds.min[DIRECTION], bounds.max[DIRECTION])
    near = bounds.min[RANGE]
    swap = near[other] < near[one]
    front, back = np.where(swap, other, one), np.where(swap, one, other)
    beams = (bounds.min[ELEVATION][back] - bounds.max[ELEVATION][front]) / beam_rad[back]
    adjacent = near[back] - bounds.max[RANGE][front] < c.max_gap_m
    adjacent &= (beams > c.min_gap_beams) & (beams < c.max_gap_beams)
    person = person_like(bounds, c)
    adjacent &= ~(person[front] | person[back])
    front, back = front[adjacent], back[adjacent]
    a, b = bounds.take(front), bounds.take(back)
    both = ViewBounds(np.minimum(a.min, b.min), np.maximum(a.max, b.max), a.scale_m)
    car = fits(both, c) & (both.width_m > c.min_width_m)
    car &= (both.max[HEIGHT] > c.min_top_m) & (both.min[HEIGHT] < c.max_bottom_m)
    return front[car], back[car]


def person_like(bounds: ViewBounds, config: CarMergeConfig) -> Bool:
    """(G,) may be a person."""
    size = PersonSize(config.max_person_width_m, config.min_person_height_m, config.min_person_top_m)
    return size.fits(bounds.width_m, bounds.min[HEIGHT], bounds.max[HEIGHT])


def fits(bounds: ViewBounds, config: CarMergeConfig) -> Bool:
    """(G,) no larger than a car."""
    fits: Bool = bounds.diagonal_m2 < np.square(np.float32(config.max_diagonal_m))
    fits &= (bounds.width_m < config.max_width_m) & (bounds.max[HEIGHT] < config.max_top_m)
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
