"""Splitting of people from what they are clustered with.

From above, two people an arm's length apart are one cluster; from the sensor there is a gap in azimuth or a step in
depth between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.clusters import Clusters, ClusterSizes
from modt.segmentation.groups import consecutive
from modt.types import Bool, Float32, Float64, Int

MIN_DEPTH_M = np.float32(0.1)
"""Bound of a divisor: points beside or behind the sensor have no azimuth relative to their cluster."""


@dataclass(frozen=True, slots=True)
class AzimuthColumns:
    """C azimuth columns of some clusters as the sensor sees them, right to left; the last of a cluster is empty."""

    group: Int  # (C,) cluster of each column
    width_m: Float64  # (C,) at the range of the cluster [m]
    returns: Int  # (C,) number of points
    expected: Float64  # (C,) number of points that a person returns
    near_m: Float32  # (C,) least depth of the points [m]
    depth_m: Float64  # (C,) mean depth of the points [m]
    top_m: Float32  # (C,) greatest height above ground [m]


class PersonSplitter:
    """Splits people from neighbouring people and objects.

    Args:
        sensor: angles between returns.
        config: `min_points` and the keys of `person_splitting`.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        self.config = c = config.person_splitting
        self.azimuth_rad = float(np.deg2rad(sensor.azimuth_step_deg))
        self.min_points = max(c.min_points, config.min_points)

    def candidates(self, sizes: ClusterSizes) -> Bool:
        """(G,) clusters that can be a person and something else."""
        c, extent = self.config, sizes.extent_m
        candidate: Bool = (extent > c.min_extent_m) & (extent < c.max_extent_m) & (sizes.top_m > c.min_top_m)
        candidate &= (sizes.points >= 2 * self.min_points) & (c.min_beams * sizes.beam_m < c.visible_m)
        candidate &= np.square(sizes.sqrt_range) > c.min_range_extents * extent
        return candidate

    def split(self, clusters: Clusters, candidate: Bool, beam_m: Float32) -> tuple[Int, int]:
        """(C,) cluster of each cell after splitting the (n,) candidates; number of clusters, new ones from n.

        Args:
            clusters: all.
            candidate: (n,) those to split.
            beam_m: (n,) vertical distance of neighbouring beams.
        """
        cluster, n = clusters.of_cell, clusters.n
        rows = np.flatnonzero(candidate[cluster].take(clusters.cell))
        if not len(rows):
            return cluster, n
        cell, points = clusters.cell[rows], clusters.points
        group = consecutive(candidate)[cluster[cell]]
        column, columns = self.project(
            points.x[rows], points.y[rows], clusters.height[rows], group, beam_m[candidate]
        )
        boundaries = self.boundaries(columns)
        if not len(boundaries):
            return cluster, n
        side = np.searchsorted(boundaries, column, side="right") - 1
        left = np.flatnonzero((side >= 0) & (columns.group[boundaries[side]] == group))
        split = cluster.copy()
        split[cell[left]] = n + side[left]
        return split, n + len(boundaries)

    def project(
        self, x: Float32, y: Float32, height: Float32, group: Int, beam_m: Float32
    ) -> tuple[Int, AzimuthColumns]:
        """(K,) azimuth column of each point, and the columns, given the (K,) groups 0 to G - 1 of the points.

        beam_m is the (G,) vertical distance of neighbouring beams.
        """
        c = self.config
        count = np.bincount(group)
        middle = np.bincount(group, x) / count, np.bincount(group, y) / count
        range_m = np.hypot(*middle)
        cos, sin = ((v / range_m).astype(np.float32)[group] for v in middle)
        step = np.maximum(self.azimuth_rad, c.column_m / range_m)
        depth = x * cos + y * sin
        half = (c.max_extent_m / (range_m * step)).astype(np.int64) + 2
        ends = np.cumsum(2 * half)
        aside = np.floor((y * cos - x * sin) / (np.maximum(depth, MIN_DEPTH_M) * step.astype(np.float32)[group]))
        reach = half[group]
        column = np.clip(aside.astype(np.int64), -reach, reach - 2)
        column += ends[group] - reach
        n = int(ends[-1])
        returns = np.bincount(column, minlength=n)
        near, top = np.full(n, np.inf, np.float32), np.zeros(n, np.float32)
        np.minimum.at(near, column, depth)
        np.maximum.at(top, column, height)
        mean = np.bincount(column, depth, n) / np.maximum(returns, 1)
        expected = c.visible_m / beam_m.astype(np.float64) * step / self.azimuth_rad
        owner = np.repeat(np.arange(len(count)), 2 * half)
        return column, AzimuthColumns(owner, (step * range_m)[owner], returns, expected[owner], near, mean, top)

    def boundaries(self, columns: AzimuthColumns) -> Int:
        """Columns at which another object begins, ascending.

        A run is a sequence of filled columns of similar depth. A boundary separates two runs, one of them like a
        person, with a gap or a step in depth between them.
        """
        c = self.config
        filled = np.flatnonzero(columns.returns >= np.maximum(c.min_fill * columns.expected, 1.0))
        if not len(filled):
            return filled
        depth, near, returns = columns.depth_m[filled], columns.near_m[filled], columns.returns[filled]
        begins = np.append(True, (np.diff(filled) > 1) | (np.abs(np.diff(depth)) > c.depth_step_m))
        start = np.flatnonzero(begins)
        length = np.diff(np.append(start, len(filled)))
        first, last = filled[start], filled[start + length - 1]
        group, width = columns.group[first], length * columns.width_m[first]
        count, nearest = np.add.reduceat(returns, start), np.minimum.reduceat(near, start)
        top = np.maximum.reduceat(columns.top_m[filled], start)
        mean_depth = np.add.reduceat(returns * depth, start) / count - nearest
        wide = (width > c.min_width_m) & (count >= self.min_points)
        person = wide & (width < c.max_width_m) & (top > c.min_top_m) & (top < c.max_top_m)
        person &= mean_depth < c.max_mean_depth_m
        front = np.add.reduceat(near, start) / length
        runs = np.flatnonzero(wide)
        right, left = runs[:-1], runs[1:]
        apart = first[left] - last[right] > c.min_gap_columns
        apart |= np.abs(front[right] - front[left]) > c.depth_step_m
        apart &= (group[right] == group[left]) & (person[right] | person[left])
        boundaries: Int = (last[right[apart]] + first[left[apart]] + 1) // 2
        return boundaries
