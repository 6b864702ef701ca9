"""Strips of one car: which of the clusters that few beams show belong together, by their bounds in the view."""

from __future__ import annotations

import numpy as np

from modt.class_sizes import PersonSize
from modt.config.segmentation import CarMergeConfig
from modt.segmentation.groups import Groups
from modt.segmentation.view_bounds import DIRECTION, ELEVATION, HEIGHT, RANGE, ViewBounds
from modt.types import Bool, Float32, Int


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
