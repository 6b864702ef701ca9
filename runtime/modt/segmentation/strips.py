"""Strips of one car: which of the clusters that few beams show belong together, by their bounds in the view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import pseudo_angle
from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import PointColumns
from modt.segmentation.groups import Groups
from modt.segmentation.tuning import StripTuning
from modt.types import Bool, Float32, Int, Self

DIRECTION, RANGE, HEIGHT, ELEVATION = range(4)
"""Rows of the bounds: pseudo-angle, range [m], height above ground [m], and tangent of the elevation."""


@dataclass(frozen=True)
class ViewBounds:
    """Bounds of groups of cells as the sensor sees them, in the rows DIRECTION, RANGE, HEIGHT and ELEVATION."""

    min: Float32  # (4, G)
    max: Float32  # (4, G)
    scale_m: Float32  # (G,) metres across the ray per unit of the pseudo-angle

    @classmethod
    def of_cells(cls, points: PointColumns, ground: Float32, low: Float32, high: Float32, groups: Groups) -> Self:
        """Bounds of (C,) cells in the order of their groups.

        Given are a point of each cell, the ground below it [m, sensor frame], and the bounds of its height above it.
        """
        direction = pseudo_angle(points.x, points.y)
        range_m = np.square(points.sqrt_range)
        # The pseudo-angle is y / (|x| + |y|), so a radian is range^2 / (|x| + |y|)^2 of its units.
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
        """Common bounds of groups of these, at the scale of the first of each."""
        sorted_ = self.take(groups.rows)
        return type(self)(groups.min(sorted_.min), groups.max(sorted_.max), sorted_.scale_m[groups.offsets[:-1]])

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


def view_bounds(clusters: Clusters, strip_of_cluster: Int, n: int) -> ViewBounds:
    """Bounds of n strips in the view, given (G,) the number of each cluster among them, or NONE."""
    groups = Groups.from_labels(strip_of_cluster.take(clusters.cluster_of_cell), n)
    points = clusters.sampled.take(groups.rows)
    cells = clusters.cells
    ground = points.z - clusters.height.take(clusters.sample.take(groups.rows))
    return ViewBounds.of_cells(points, ground, cells.low.take(groups.rows), cells.high.take(groups.rows), groups)


def merge_strips(bounds: ViewBounds, beam_rad: Float32, tuning: StripTuning) -> Int:
    """(G,) first of the strips that make one car with each, itself where it is not merged.

    Pairs of strips chain up to groups; a group larger than a car is not merged at all.

    Args:
        bounds: bounds of the strips.
        beam_rad: (G,) spacing of the beams at the foot of each [rad].
        tuning: sizes of strips and cars.
    """
    strip = np.arange(len(bounds))
    near, far = pairs(bounds, beam_rad, tuning)
    if not len(near):
        return strip
    first = strip.copy()
    _propagate_min(first, near, far)
    group_of_strip = (np.cumsum(first == strip) - 1)[first]
    cars = bounds.union(Groups.from_labels(group_of_strip, int(group_of_strip.max()) + 1))
    return np.where(fits(cars, tuning)[group_of_strip], first, strip)


def pairs(bounds: ViewBounds, beam_rad: Float32, tuning: StripTuning) -> tuple[Int, Int]:
    """Nearer and farther strip of each pair that makes one car."""
    one, other = _overlapping(bounds.min[DIRECTION], bounds.max[DIRECTION])
    range_m = bounds.min[RANGE]
    swap = range_m[other] < range_m[one]
    near = np.where(swap, other, one)
    far = np.where(swap, one, other)
    gap_beams = (bounds.min[ELEVATION][far] - bounds.max[ELEVATION][near]) / beam_rad[far]
    adjacent = range_m[far] - bounds.max[RANGE][near] < tuning.max_gap_m
    adjacent &= (gap_beams > tuning.min_gap_beams) & (gap_beams < tuning.max_gap_beams)
    person = tuning.person.fits(bounds.width_m, bounds.min[HEIGHT], bounds.max[HEIGHT])
    hidden_person = tuning.hidden_person.fits(bounds.width_m, bounds.min[HEIGHT], bounds.max[HEIGHT])
    hidden_person &= range_m < tuning.max_hidden_range_m
    adjacent &= ~(person[near] | person[far] | hidden_person[far])
    near, far = near[adjacent], far[adjacent]
    a = bounds.take(near)
    b = bounds.take(far)
    both = ViewBounds(np.minimum(a.min, b.min), np.maximum(a.max, b.max), a.scale_m)
    car = fits(both, tuning) & (both.width_m > tuning.min_width_m)
    car &= (both.max[HEIGHT] > tuning.min_top_m) & (both.min[HEIGHT] < tuning.max_bottom_m)
    return near[car], far[car]


def fits(bounds: ViewBounds, tuning: StripTuning) -> Bool:
    """(G,) no larger than a car."""
    fitting: Bool = bounds.diagonal_m2 < np.square(np.float32(tuning.max_diagonal_m))
    fitting &= (bounds.width_m < tuning.max_width_m) & (bounds.max[HEIGHT] < tuning.max_top_m)
    return fitting


def _propagate_min(label: Int, one: Int, other: Int) -> None:
    """Give all entries that pairs connect the least of their labels, in place; there are few pairs."""
    while True:
        least = np.minimum(label[one], label[other])
        if (label[one] == least).all() and (label[other] == least).all():
            return
        np.minimum.at(label, one, least)
        np.minimum.at(label, other, least)


def _overlapping(start: Float32, end: Float32) -> tuple[Int, Int]:
    """Pairs of overlapping intervals, each once: each interval with those that start after it and before its end."""
    order = np.argsort(start, kind="stable")
    followers = np.searchsorted(start[order], end[order], side="right") - np.arange(1, len(order) + 1)
    place = np.repeat(np.arange(len(order)), followers)
    # Number of each pair among those of its interval, from 0 on: the pairs before it, less those of intervals before.
    rank = np.arange(len(place)) - np.repeat(np.cumsum(followers) - followers, followers)
    return order[place], order[place + 1 + rank]
