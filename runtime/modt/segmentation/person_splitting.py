"""People told apart from whoever and whatever stands beside them, by what shows between: a gap, or a step in depth.

Seen from above, two people an arm's length apart are one cluster; seen from the sensor, there is daylight between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.columns import Columns
from modt.types import Bool, Float32, Float64, Int

COMPANY_M = (0.8, 3.0)
"""A cluster that holds a person and more is this long: two people side by side, or one beside a bush."""
AROUND = 1.5
"""What is not this many times its length away surrounds the sensor and has no sides ..."""
NEAR_M = np.float32(0.1)
"""... nor has what is nearer than this."""
HEAD_M = (1.1, 2.2)
"""Heads end between these heights above ground: those of children of five, and of tall people on a kerb."""
BREADTH_M = (0.2, 0.85)
"""Breadth of a person, seen sideways or from the front."""
DEPTH_M = 0.8
"""What is nearest in the columns of a person varies no more than this along the ray ..."""
HOLLOW_M = 0.35
"""... and on average their returns lie no farther behind the nearest; those of half a car do: its roof."""
POINTS = 8
"""A part must have so many."""
UPRIGHT_M = 1.5
"""What of a person stands clear of the ground, about ..."""
BEAMS = 4.0
"""... and must meet this many beams; fewer, and it cannot be told from half a car ..."""
FILLED = 0.3
"""... and how much of it a column must show lest it count as seen through: feet, or a hand, fill less."""
COLUMN_M = 0.06
"""Breadth of a column of the view, where it is not that of a step of the sensor."""
GAP = 2
"""So many columns in a row are a gap; a single one may be lost to chance, and to where the beams happen to fall."""
STEP_M = 0.4
"""Between neighbours in the view that differ this much in depth passes the edge of one of them."""


@dataclass(frozen=True, slots=True)
class View:
    """The columns in which a sensor sees each of some groups, from right to left; its last is empty.

    Attributes:
        group: (C,) whom a column is of.
        breadth_m: (C,) its breadth [m].
        returns: (C,) how many points lie in it.
        expected: (C,) how many a person would return.
        near_m, depth_m: (C,) least and mean depth of its points [m].
        top_m: (C,) greatest height above ground [m].
    """

    group: Int
    breadth_m: Float64
    returns: Int
    expected: Float64
    near_m: Float32
    depth_m: Float64
    top_m: Float32


class Silhouettes:
    """Parts people from what they are clustered with.

    Args:
        sensor: how far apart its returns lie.
        config: fewest points of a proposal.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        self.beam_rad = float(np.deg2rad(sensor.elevation_step_deg))
        self.step_rad = float(np.deg2rad(sensor.azimuth_step_deg))
        self.points = max(POINTS, config.min_points)
        self.range_m = UPRIGHT_M / (BEAMS * self.beam_rad)

    def company(self, extent: Float32, top: Float32, points: Int, root: Float32) -> Bool:
        """(n,) which clusters may hold a person and more.

        Args:
            extent: (n,) diagonal of each [m].
            top: (n,) greatest height above ground [m].
            points: (n,) how many it has.
            root: (n,) square root of its range, about [sqrt(m)].
        """
        company: Bool = (extent > COMPANY_M[0]) & (extent < COMPANY_M[1]) & (top > HEAD_M[0])
        company &= (points >= 2 * self.points) & (root < np.float32(np.sqrt(self.range_m)))
        company &= np.square(root) > AROUND * extent
        return company

    def parted(self, points: Columns, height: Float32, cell: Int, cluster: Int, company: Bool) -> tuple[Int, int]:
        """(C,) cluster of each cell with people apart, and how many clusters there are.

        Args:
            points: (K,) what is raised.
            height: (K,) of each point above ground [m].
            cell: (K,) cell of each point.
            cluster: (C,) cluster of each cell, NONE where it has none.
            company: (n,) clusters to look at, none of them empty.
        """
        n = len(company)
        rows = np.flatnonzero(np.append(company, False)[cluster].take(cell))  # the last one is that of NONE
        if not len(rows):
            return cluster, n
        cell = cell[rows]
        group = (np.cumsum(company) - 1)[cluster[cell]]
        column, view = self.view(points.x[rows], points.y[rows], height[rows], group)
        cuts = self.cuts(view)
        if not len(cuts):
            return cluster, n
        cut = np.searchsorted(cuts, column, side="right") - 1
        left = np.flatnonzero((cut >= 0) & (view.group[cuts[cut]] == group))
        new = cluster.copy()
        new[cell[left]] = n + cut[left]
        return new, n + len(cuts)

    def view(self, x: Float32, y: Float32, height: Float32, group: Int) -> tuple[Int, View]:
        """(K,) column of each point of groups, none empty or around the sensor, and what is seen in each column."""
        count = np.bincount(group)
        middle = np.bincount(group, x) / count, np.bincount(group, y) / count
        range_m = np.hypot(*middle)
        c, s = ((v / range_m).astype(np.float32)[group] for v in middle)
        step = np.maximum(self.step_rad, COLUMN_M / range_m)
        depth = x * c + y * s
        half = (COMPANY_M[1] / (range_m * step)).astype(np.int64) + 2
        ends = np.cumsum(2 * half)
        aside = np.floor((y * c - x * s) / (np.maximum(depth, NEAR_M) * step.astype(np.float32)[group]))
        reach = half[group]
        column = np.clip(aside.astype(np.int64), -reach, reach - 2)
        column += ends[group] - reach
        n = int(ends[-1])
        returns = np.bincount(column, minlength=n)
        near, top = np.full(n, np.inf, np.float32), np.zeros(n, np.float32)
        np.minimum.at(near, column, depth)
        np.maximum.at(top, column, height)
        mean = np.bincount(column, depth, n) / np.maximum(returns, 1)
        expected = UPRIGHT_M / (range_m * self.beam_rad) * step / self.step_rad
        owner = np.repeat(np.arange(len(count)), 2 * half)
        return column, View(owner, (step * range_m)[owner], returns, expected[owner], near, mean, top)

    def cuts(self, view: View) -> Int:
        """Columns from which on something else is seen, ascending."""
        filled = np.flatnonzero(view.returns >= np.maximum(FILLED * view.expected, 1.0))
        if not len(filled):
            return filled
        depth, near, returns = view.depth_m[filled], view.near_m[filled], view.returns[filled]
        begins = np.append(True, (np.diff(filled) > 1) | (np.abs(np.diff(depth)) > STEP_M))
        start = np.flatnonzero(begins)
        length = np.diff(np.append(start, len(filled)))
        first, last = filled[start], filled[start + length - 1]
        group, breadth = view.group[first], length * view.breadth_m[first]
        count, nearest = np.add.reduceat(returns, start), np.minimum.reduceat(near, start)
        head = np.maximum.reduceat(view.top_m[filled], start)
        hollow = np.add.reduceat(returns * depth, start) / count - nearest
        broad = (breadth > BREADTH_M[0]) & (count >= self.points)
        person = broad & (breadth < BREADTH_M[1]) & (head > HEAD_M[0]) & (head < HEAD_M[1])
        person &= (np.maximum.reduceat(near, start) - nearest < DEPTH_M) & (hollow < HOLLOW_M)
        front = np.add.reduceat(near, start) / length
        parts = np.flatnonzero(broad)
        right, left = parts[:-1], parts[1:]
        apart = (first[left] - last[right] > GAP) | (np.abs(front[right] - front[left]) > STEP_M)
        apart &= (group[right] == group[left]) & (person[right] | person[left])
        cuts: Int = (last[right[apart]] + first[left[apart]] + 1) // 2
        return cuts
