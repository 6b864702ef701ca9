"""Bounds of clusters in the view of the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import pseudo_angle
from modt.segmentation.groups import Groups
from modt.segmentation.point_columns import PointColumns
from modt.types import Float32, Int

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
