"""The passes over points, cells and groups that segmentation consists of, as one interface."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from modt.geometry.kernels import GeometryKernels, NumpyGeometryKernels
from modt.segmentation.clusters import (
    Cells,
    ClusterBounds,
    Clusters,
    Members,
    cluster_bounds,
    connect,
    connect_coarse,
    members_of,
    occupied_cells,
)
from modt.segmentation.grids import PointColumns, SqrtRangeGrid
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.groups import Groups, best_headings, reflectance_sums
from modt.segmentation.strips import CarLimits, ViewBounds, merge_strips, view_bounds
from modt.types import Bool, Float32, Float64, Int


class Kernels(GeometryKernels, Protocol):
    """The passes, with those of geometry; every implementation gives the same bytes for the same input."""

    @property
    def name(self) -> str:
        """For the record of a run."""

    def above_ground(
        self, ground: GroundEstimator, points: Float32, sensor_height_m: float, bounds: Float32
    ) -> tuple[Int, PointColumns, Float32]:
        """(K,) rows of (N, 3) or wider points within bounds, those points, and their (K,) heights above ground [m].

        Bounds are the least and greatest height [m], and the least and greatest square root of range, exclusively.
        """

    def occupied_cells(
        self, grid: SqrtRangeGrid, points: PointColumns, height: Float32
    ) -> tuple[Cells, Int, PointColumns, Int]:
        """Cells of (K,) points with (K,) heights [m], (C,) last point of each, those points, (K,) cell of each."""

    def connect(self, grid: SqrtRangeGrid, cells: Cells, max_gap_m: Float32, use: Bool) -> Int:
        """(C,) connected component of each cell used, in the order of their first cells, NONE for the others."""

    def connect_coarse(self, grid: SqrtRangeGrid, cells: Cells, max_gap_m: Float32) -> Int:
        """(C,) connected component of the cell of the grid, twice as wide, in which each cell lies."""

    def cluster_bounds(self, cells: Cells, points: PointColumns, cluster: Int, n: int) -> ClusterBounds:
        """Bounds of n clusters, given (C,) the cluster of each cell, or NONE, and a point of each cell."""

    def view_bounds(self, clusters: Clusters, number: Int, n: int) -> ViewBounds:
        """Bounds of n clusters in the view, given (G,) the number of each, or NONE."""

    def merge_strips(self, bounds: ViewBounds, beam_rad: Float32, limits: CarLimits) -> Int:
        """(G,) first of the clusters that make one car with each, given (G,) the spacing of beams there [rad]."""

    def group(self, labels: Int, n: int) -> Groups:
        """Groups 0 to n - 1 of the rows with these labels; rows labelled NONE are left out."""

    def members_of(self, clusters: Clusters, index: Int) -> Members:
        """Points of each cluster, given (K,) the row of each point in the sweep."""

    def best_headings(self, x: Float32, y: Float32, groups: Groups, limit: int, noise_m: float) -> Int:
        """(G,) index of the heading whose sides the points of a group, at most `limit` of them, are closest to."""

    def reflectance_sums(self, points: Float32, index: Int, offsets: Int) -> tuple[Float64, Float32]:
        """(5, G) number, sum, sum of squares, bright and dark ones of the measured values, (G,) greatest."""


class NumpyKernels(NumpyGeometryKernels):
    """The passes in NumPy: the reference."""

    name = "numpy"
    occupied_cells = staticmethod(occupied_cells)
    connect = staticmethod(connect)
    connect_coarse = staticmethod(connect_coarse)
    cluster_bounds = staticmethod(cluster_bounds)
    view_bounds = staticmethod(view_bounds)
    merge_strips = staticmethod(merge_strips)
    group = staticmethod(Groups.from_labels)
    members_of = staticmethod(members_of)
    best_headings = staticmethod(best_headings)
    reflectance_sums = staticmethod(reflectance_sums)

    def above_ground(
        self, ground: GroundEstimator, points: Float32, sensor_height_m: float, bounds: Float32
    ) -> tuple[Int, PointColumns, Float32]:
        """(K,) rows of the points within bounds, those points, and their (K,) heights above ground [m]."""
        sweep = PointColumns.from_array(points)
        height = ground.height_above(sweep, sensor_height_m)
        low, high, near, far = bounds
        mask = (height > low) & (height < high)
        mask &= (sweep.sqrt_range > near) & (sweep.sqrt_range < far)
        rows = np.flatnonzero(mask)
        return rows, sweep.take(rows), height[rows]


NUMPY = NumpyKernels()
