"""People told apart from whoever and whatever stands beside them, by what shows between: a gap, or a step in depth.

Seen from above, two people an arm's length apart are one cluster; seen from the sensor, there is daylight between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.columns import Columns
from modt.types import NONE, Bool, Float32, Float64, Int

COMPANY_M = 5.0
"""A cluster longer than this is no company of a few people, nor one beside a bush ..."""
HEAD_M = (1.1, 2.2)
"""... and one whose top is lower than a child's holds nobody. Heads end between these heights above ground."""
COLUMN_M = 0.06
"""Breadth of a column of the view, where it is not that of a step of the sensor."""
UPRIGHT_M = 1.5
"""What of a person stands clear of the ground, about ..."""
FILLED = 0.3
"""... and how much of it a column must show lest it count as see-through: feet, or a hand, fill less."""
BEAMS = 4.0
"""A person who meets fewer beams than this cannot be told from half a car."""
GAP = 2
"""So many columns in a row are a gap; a single one may be lost to chance, and to where the beams happen to fall."""
STEP_M = 0.4
"""Between neighbours in the view that differ this much in depth passes the edge of one of them."""
BREADTH_M = (0.2, 0.85)
"""Breadth of a person, seen sideways or from the front."""
DEPTH_M = 0.8
"""Length of a person along the ray ..."""
BEYOND = 0.1
"""... and the share of what lies in the same columns that may lie farther behind; of half a car more does."""
TALL_M = 0.7
"""From the lowest to the highest return, a person seen in part still has this."""
POINTS = 8
"""A part must have so many."""


@dataclass(frozen=True, slots=True)
class View:
    """The columns in which a sensor sees each of some groups; every group ends with one that is empty.

    Attributes:
        column: (K,) column of each point.
        group: (C,) whom each column is of.
        range_m, breadth_m: (G,) mean range of each group, breadth of its columns [m].
        filled: (C,) whether it is not seen through.
        near_m, depth_m: (C,) least and mean distance in it, along the ray to its group's middle [m].
    """

    column: Int
    group: Int
    range_m: Float64
    breadth_m: Float64
    filled: Bool
    near_m: Float32
    depth_m: Float64


@dataclass(frozen=True, slots=True)
class Runs:
    """Filled columns side by side without a step in depth.

    Attributes:
        group: (R,) whom each is of.
        first, last: (R,) the columns it begins and ends with.
        near_m: (R,) mean of what is nearest in each of its columns [m].
        broad: (R,) as broad as a person, at least, and with points enough.
        person: (R,) as broad, deep and tall as one.
    """

    group: Int
    first: Int
    last: Int
    near_m: Float64
    broad: Bool
    person: Bool


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

    def parted(self, points: Columns, height: Float32, cell: Int, cluster: Int, company: Bool) -> tuple[Int, int]:
        """(C,) cluster of each cell with people apart, and how many clusters there are.

        Args:
            points: (K,) what is raised.
            height: (K,) of each point above ground [m].
            cell: (K,) cell of each point.
            cluster: (C,) cluster of each cell, NONE where it has none.
            company: (n,) clusters to look at.
        """
        n = len(company)
        likely = np.append(company, False)[cluster]  # the last one is that of NONE
        rows = np.flatnonzero(likely[cell])
        if not len(rows):
            return cluster, n
        number = np.cumsum(company) - 1
        cell = cell[rows]
        group, height = number[cluster[cell]], height[rows]
        view, depth = self.view(points.x[rows], points.y[rows], group)
        cuts = self.cuts(view, self.runs(view, depth, height))
        if not len(cuts):
            return cluster, n
        return _divided(cell, cluster, view, cuts, n)

    def view(self, x: Float32, y: Float32, group: Int) -> tuple[View, Float32]:
        """What is seen of (K,) points of groups, none of them empty, and (K,) the depth of each [m]."""
        count = np.bincount(group)
        middle = np.bincount(group, x) / count, np.bincount(group, y) / count
        range_m = np.maximum(np.hypot(*middle), 1e-3)
        c, s = ((v / range_m).astype(np.float32)[group] for v in middle)
        depth = x * c + y * s
        aside = (y * c - x * s) / np.maximum(depth, np.float32(1e-3))
        step = np.maximum(self.step_rad, COLUMN_M / range_m)
        right = np.full(len(count), np.inf, np.float32)
        np.minimum.at(right, group, aside)
        column = ((aside - right[group]) / step.astype(np.float32)[group]).astype(np.int64)
        columns = np.zeros(len(count), np.int64)
        np.maximum.at(columns, group, column)
        columns += 2
        ends = np.cumsum(columns)
        column += (ends - columns)[group]
        expected = UPRIGHT_M / (range_m * self.beam_rad) * (step / self.step_rad)
        owner = np.repeat(np.arange(len(count)), columns)
        returns = np.bincount(column, minlength=ends[-1])
        filled = returns >= np.maximum(FILLED * expected, 1.0)[owner]
        near = np.full(ends[-1], np.inf, np.float32)
        np.minimum.at(near, column, depth)
        mean = np.bincount(column, depth, ends[-1]) / np.maximum(returns, 1)
        return View(column, owner, range_m, step * range_m, filled, near, mean), depth

    def runs(self, view: View, depth: Float32, height: Float32) -> Runs:
        """The runs of a view of (K,) points, from right to left, group by group."""
        filled = np.flatnonzero(view.filled)
        near = view.near_m[filled]
        begins = np.append(True, (np.diff(filled) > 1) | (np.abs(np.diff(view.depth_m[filled])) > STEP_M))[
            : len(filled)
        ]
        run, n = np.cumsum(begins) - 1, int(begins.sum())
        start = np.flatnonzero(begins)
        first, length = filled[start], np.diff(np.append(start, len(filled)))
        group = view.group[first]
        breadth = length * view.breadth_m[group]
        nearest, farthest = (f.reduceat(near, start) if n else near for f in (np.minimum, np.maximum))

        of_column = np.full(len(view.group), NONE)
        of_column[filled] = run
        of_point = of_column[view.column]
        inside = np.flatnonzero(of_point != NONE)
        of_point, tall = of_point[inside], height[inside]
        count = np.bincount(of_point, minlength=n)
        behind = np.bincount(of_point, depth[inside] > nearest[of_point] + np.float32(DEPTH_M), n)
        foot, head = np.full(n, np.inf, np.float32), np.zeros(n, np.float32)
        np.minimum.at(foot, of_point, tall)
        np.maximum.at(head, of_point, tall)
        broad = (breadth > BREADTH_M[0]) & (count >= self.points)
        person = broad & (breadth < BREADTH_M[1]) & (head > HEAD_M[0]) & (head < HEAD_M[1]) & (head - foot > TALL_M)
        person &= (farthest - nearest < DEPTH_M) & (behind <= BEYOND * count)
        person &= UPRIGHT_M > BEAMS * self.beam_rad * view.range_m[group]
        return Runs(group, first, first + length - 1, np.bincount(run, near, n) / length, broad, person)

    def cuts(self, view: View, runs: Runs) -> Int:
        """Columns from which on something else is seen, ascending."""
        broad = np.flatnonzero(runs.broad)
        right, left = broad[:-1], broad[1:]
        apart = runs.first[left] - runs.last[right] > GAP
        apart |= np.abs(runs.near_m[right] - runs.near_m[left]) > STEP_M
        apart &= (runs.group[right] == runs.group[left]) & (runs.person[right] | runs.person[left])
        cuts: Int = (runs.last[right[apart]] + runs.first[left[apart]] + 1) // 2
        return cuts


def _divided(cell: Int, cluster: Int, view: View, cuts: Int, n: int) -> tuple[Int, int]:
    """(C,) cluster of each cell, a new one left of each cut, and how many there are."""
    cut = np.searchsorted(cuts, view.column, side="right") - 1
    left = (cut >= 0) & (view.group[cuts[cut]] == view.group[view.column])
    new = np.full(len(cluster), NONE)
    np.maximum.at(new, cell[left], cut[left])
    divided = np.where(new == NONE, cluster, n + new)
    kept = np.bincount(divided[divided != NONE], minlength=n + len(cuts)) > 0
    number = np.append(np.where(kept, np.cumsum(kept) - 1, NONE), NONE)  # the last one is that of NONE
    return number[divided], int(kept.sum())
