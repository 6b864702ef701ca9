"""Strips of one car: which of the clusters that few beams show belong together, by their bounds in the view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.class_sizes import STRIP_PERSON
from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import PointColumns, pseudo_angle
from modt.segmentation.groups import Groups
from modt.types import Bool, Float32, Int, Self

DIRECTION, RANGE, HEIGHT, ELEVATION = range(4)
MIN_POINTS = 2
"""Least number of points of a strip."""
VISIBLE_M, MAX_BEAMS = 1.5, 8.0
"""Height of a car, and the beams on it from which a cluster is a whole car and no strip."""


@dataclass(frozen=True, slots=True)
class CarLimits:
    """Bounds of strips that make one car, and of that car."""

    max_diagonal_m: float = 6.0
    """Greatest diagonal from above of a strip and of the car."""
    min_width_m: float = 0.7
    max_width_m: float = 5.2
    """Width of the car across the ray."""
    min_top_m: float = 0.8
    max_top_m: float = 2.2
    max_bottom_m: float = 0.8
    """Top and bottom of the car above ground."""
    max_gap_m: float = 1.8
    """Greatest distance in range between two strips, the length of a bonnet."""
    min_gap_beams: float = -1.0
    max_gap_beams: float = 2.0
    """Distance in elevation from the nearer strip to the farther one."""


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


def merge_strips(bounds: ViewBounds, beam_rad: Float32, limits: CarLimits) -> Int:
    """(G,) first of the clusters that make one car with each, itself where it is not merged.

    Args:
        bounds: bounds of the clusters.
        beam_rad: (G,) spacing of the beams at the foot of each [rad].
        limits: sizes of strips and cars.
    """
    self_index = np.arange(len(bounds))
    representative = self_index.copy()
    front, back = pairs(bounds, beam_rad, limits)
    if len(front):
        _propagate_min(representative, front, back)
        car_id = (np.cumsum(representative == self_index) - 1)[representative]
        cars = bounds.union(Groups.from_labels(car_id, int(car_id.max()) + 1))
        representative = np.where(fits(cars, limits)[car_id], representative, self_index)
    return representative


def pairs(bounds: ViewBounds, beam_rad: Float32, limits: CarLimits) -> tuple[Int, Int]:
    """Nearer and farther cluster of each pair of strips of one car."""
    c = limits
    one, other = _overlapping(bounds.min[DIRECTION], bounds.max[DIRECTION])
    near = bounds.min[RANGE]
    swap = near[other] < near[one]
    front, back = np.where(swap, other, one), np.where(swap, one, other)
    beams = (bounds.min[ELEVATION][back] - bounds.max[ELEVATION][front]) / beam_rad[back]
    adjacent = near[back] - bounds.max[RANGE][front] < c.max_gap_m
    adjacent &= (beams > c.min_gap_beams) & (beams < c.max_gap_beams)
    person = STRIP_PERSON.fits(bounds.width_m, bounds.min[HEIGHT], bounds.max[HEIGHT])
    adjacent &= ~(person[front] | person[back])
    front, back = front[adjacent], back[adjacent]
    a, b = bounds.take(front), bounds.take(back)
    both = ViewBounds(np.minimum(a.min, b.min), np.maximum(a.max, b.max), a.scale_m)
    car = fits(both, c) & (both.width_m > c.min_width_m)
    car &= (both.max[HEIGHT] > c.min_top_m) & (both.min[HEIGHT] < c.max_bottom_m)
    return front[car], back[car]


def fits(bounds: ViewBounds, limits: CarLimits) -> Bool:
    """(G,) no larger than a car."""
    fits: Bool = bounds.diagonal_m2 < np.square(np.float32(limits.max_diagonal_m))
    fits &= (bounds.width_m < limits.max_width_m) & (bounds.max[HEIGHT] < limits.max_top_m)
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
