"""Cars made whole of the strips in which few beams show them: a rear and, a metre behind, a strip of roof.

Seen from above there is a gap between them; seen from the sensor, one begins where the other ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.columns import Columns
from modt.segmentation.grids import pseudo_angle
from modt.segmentation.groups import Groups
from modt.types import Bool, Float32, Int

DIAGONAL_M = 6.0
"""A car, and a piece of one, is no longer than this, corner to corner, ..."""
BREADTH_M = (0.7, 5.2)
"""... so broad, across the ray, ..."""
TOP_M = (0.8, 2.2)
"""... ends so high above ground ..."""
BOTTOM_M = 0.8
"""... and is seen to begin below this."""
BEHIND_M = 1.8
"""A piece begins no farther behind the end of the one before it: bonnet and rear window are shorter."""
BEAMS = (-1.0, 2.0)
"""In elevation it begins so many beams above the end of the one before it: nothing is seen between them."""
UPRIGHT_M = (0.9, 1.1, 0.7)
"""What is narrower than this, ends higher and rises more may be a person: no piece of a car."""
TALL_M, FEW = 1.5, 8.0
"""Nearer than where so much of a car meets so few beams, cars do not fall into strips."""
POINTS = 2
"""A piece has so many."""
DIRECTION, RANGE, HEIGHT, ELEVATION = range(4)


@dataclass(frozen=True, slots=True)
class Bounds:
    """What groups of cells fill of the sensor's view.

    Attributes:
        least, most: (4, G) bounds of direction [pseudo-angle], range [m], height above ground [m] and elevation
            [tangent].
        turn_m: (G,) metres across the ray to a unit of the pseudo-angle.
    """

    least: Float32
    most: Float32
    turn_m: Float32

    @classmethod
    def of(cls, points: Columns, ground: Float32, low: Float32, high: Float32, groups: Groups) -> Self:
        """Bounds of cells in groups.

        Args:
            points: (C,) a point of each cell.
            ground: (C,) height of the ground beneath it [m, sensor frame].
            low: (C,) least height of a cell's points above ground [m].
            high: (C,) the greatest [m].
            groups: which cells belong together.
        """
        x, y, root, ground, low, high = (
            v.take(groups.rows) for v in (points.x, points.y, points.root, ground, low, high)
        )
        direction, range_m = pseudo_angle(x, y), np.square(root)
        turn_m = np.square(np.abs(x) + np.abs(y)) / range_m
        least = groups.least(np.stack([direction, range_m, low, (low + ground) / range_m]))
        most = groups.most(np.stack([direction, range_m, high, (high + ground) / range_m]))
        return cls(least, most, turn_m[groups.offsets[:-1]].astype(np.float32, copy=False))

    def take(self, rows: Int) -> Self:
        """The groups given."""
        return type(self)(self.least[:, rows], self.most[:, rows], self.turn_m[rows])

    def over(self, groups: Groups) -> Self:
        """Bounds of groups of these."""
        every = self.take(groups.rows)
        return type(self)(groups.least(every.least), groups.most(every.most), every.turn_m[groups.offsets[:-1]])

    def beside(self, other: Self) -> Self:
        """Bounds of each with its counterpart."""
        return type(self)(np.minimum(self.least, other.least), np.maximum(self.most, other.most), self.turn_m)

    @property
    def breadth_m(self) -> Float32:
        """(G,) extent across the ray [m]."""
        breadth_m: Float32 = (self.most[DIRECTION] - self.least[DIRECTION]) * self.turn_m
        return breadth_m

    def upright(self) -> Bool:
        """(G,) may be people."""
        top = self.most[HEIGHT]
        upright: Bool = self.breadth_m < UPRIGHT_M[0]
        upright &= (top > UPRIGHT_M[1]) & (top - self.least[HEIGHT] > UPRIGHT_M[2])
        return upright

    def small(self, diagonal_m: float) -> Bool:
        """(G,) no larger than a car, nor than so much."""
        breadth, depth = self.breadth_m, self.most[RANGE] - self.least[RANGE]
        small: Bool = np.hypot(breadth, depth) < min(DIAGONAL_M, diagonal_m)
        small &= (breadth < BREADTH_M[1]) & (self.most[HEIGHT] < TOP_M[1])
        return small

    def like_cars(self, diagonal_m: float) -> Bool:
        """(G,) of a car's size, and no larger than so much."""
        like = self.small(diagonal_m)
        like &= (self.breadth_m > BREADTH_M[0]) & (self.most[HEIGHT] > TOP_M[0]) & (self.least[HEIGHT] < BOTTOM_M)
        return like


class Pieces:
    """Finds what is one car among clusters.

    What spans the direction straight to the right, where pseudo-angles begin anew, is left as it is.

    Args:
        sensor: the spacing of its beams.
        max_extent_m: of an object.
    """

    def __init__(self, sensor: SensorConfig, max_extent_m: float = DIAGONAL_M) -> None:
        self.max_extent_m = max_extent_m
        beam = float(np.tan(np.deg2rad(sensor.elevation_step_deg)))
        self.steps = BEAMS[0] * beam, BEAMS[1] * beam
        self.range_m = TALL_M / (FEW * beam)

    def possible(self, extent: Float32, top: Float32, points: Int, root: Float32) -> Bool:
        """(n,) which clusters may be a piece of a car.

        Args:
            extent: (n,) diagonal of each [m].
            top: (n,) greatest height above ground [m].
            points: (n,) how many it has.
            root: (n,) square root of its range, about [sqrt(m)].
        """
        possible: Bool = (points >= POINTS) & (extent < DIAGONAL_M) & (top < TOP_M[1])
        possible &= root > np.float32(np.sqrt(self.range_m))
        return possible

    def whole(self, bounds: Bounds) -> Int:
        """(G,) first of the groups with which each makes a car, itself where it is no piece of one."""
        own = np.arange(len(bounds.turn_m))
        first = own.copy()
        front, back = self.pairs(bounds)
        if len(front):
            _spread(first, front, back)
            number = (np.cumsum(first == own) - 1)[first]
            fits = bounds.over(Groups.of(number, int(number.max()) + 1)).small(self.max_extent_m)[number]
            first = np.where(fits, first, own)
        return first

    def pairs(self, bounds: Bounds) -> tuple[Int, Int]:
        """Pairs of groups that are pieces of one car, the nearer of each and the one seen right above it."""
        one, other = _overlapping(bounds.least[DIRECTION], bounds.most[DIRECTION])
        near = bounds.least[RANGE]
        turn = near[other] < near[one]
        front, back = np.where(turn, other, one), np.where(turn, one, other)
        step = bounds.least[ELEVATION][back] - bounds.most[ELEVATION][front]
        joined = near[back] - bounds.most[RANGE][front] < BEHIND_M
        joined &= (step > self.steps[0]) & (step < self.steps[1])
        upright = bounds.upright()
        joined &= ~(upright[front] | upright[back])
        front, back = front[joined], back[joined]
        like = bounds.take(front).beside(bounds.take(back)).like_cars(self.max_extent_m)
        return front[like], back[like]


def _spread(name: Int, one: Int, other: Int) -> None:
    """Give everyone that pairs link, through whomever, the least of their names; there are few."""
    while True:
        least = np.minimum(name[one], name[other])
        if (name[one] == least).all() and (name[other] == least).all():
            return
        np.minimum.at(name, one, least)
        np.minimum.at(name, other, least)


def _overlapping(start: Float32, end: Float32) -> tuple[Int, Int]:
    """Pairs of intervals that meet, each pair once."""
    order = np.argsort(start, kind="stable")
    following = np.searchsorted(start[order], end[order], side="right") - np.arange(1, len(order) + 1)
    one = np.repeat(np.arange(len(order)), following)
    rank = np.arange(len(one)) - np.repeat(np.cumsum(following) - following, following)
    return order[one], order[one + 1 + rank]
