"""The passes of segmentation in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from array import array
from operator import attrgetter
from typing import Any

import numpy as np

from modt.class_sizes import SPLIT_PERSON, STRIP_PERSON
from modt.geometry.native_kernels import NativeGeometryKernels
from modt.native.library import FLOAT32, INT32, INT64, Own, Signatures, declare, pointers, structure
from modt.segmentation.ceiling import ABOVE_M, BIN_M, bins_up_to
from modt.segmentation.clusters import (
    MAX_CELL_GAP_BEAMS,
    MAX_CELL_GAP_M,
    MIN_PERSON_POINTS,
    MIN_SPLIT_M,
    CellClusterer,
    Cells,
    Clusters,
    ClusterSizes,
    Members,
)
from modt.segmentation.grids import FAR_M, RING_STEP, SECTORS, PointColumns, SqrtRangeGrid
from modt.segmentation.ground import FLANK_M, FLANK_SECTORS, MAX_GAP_M, NEAR_M, NOISE_M, SLOPE_GAIN, GroundEstimator
from modt.segmentation.groups import AXES, BRIGHT, DARK, HEADINGS, Groups
from modt.segmentation.kernels import Kernels
from modt.segmentation.strips import DIRECTION, CarLimits, ViewBounds
from modt.types import N_REFLECTANCE, Float32, Float64, Int

_F, _I, _L = ctypes.c_float, ctypes.c_int32, ctypes.c_int64
_SIGNATURES: Signatures = {
    "modt_above_ground": (_L, (Own, FLOAT32, Own, _F, FLOAT32, _L, Own, Own, FLOAT32, *[Own] * 3)),
    "modt_occupied_cells": (_L, (Own, FLOAT32, _L, _F, _I, _I, INT32, Own, Own, Own, Own)),
    "modt_cluster": (_L, (Own, Own, Own, FLOAT32, _L, _I, _I, Own, Own, Own)),
    "modt_view_bounds": (None, (Own, Own, FLOAT32, INT64, INT64, _L, INT64, _L, Own, Own)),
    "modt_merge_strips": (None, (Own, Own, FLOAT32, FLOAT32, _L, INT64, Own, Own, Own)),
    "modt_group": (_L, (INT64, _L, _L, Own, Own)),
    "modt_members": (None, (Own, INT64, _L, INT64, INT64, _L, _L, Own)),
    "modt_best_headings": (None, (FLOAT32, FLOAT32, INT64, INT64, _L, _L, FLOAT32, FLOAT32, _I, _F, Own)),
    "modt_reflectance_statistics": (None, (FLOAT32, _L, INT64, INT64, _L, _F, _F, Own)),
}


class _Ground(ctypes.Structure):
    """Ground of ground.c."""

    _fields_ = (
        *((name, _I) for name in ("rings", "sectors", "sector_bits", "flank_sectors", "bonnet_ring")),
        *((name, _F) for name in ("far_m", "ring_scale", "sector_scale", "min_sqrt_range", "max_slope")),
        *(
            (name, _F)
            for name in ("ramp_slope", "near_m", "slope_gain", "noise_m", "max_gap_m", "flank_m", "upper_m", "bin_m")
        ),
    )


_STRIP_KEYS = (
    *("max_gap_m", "min_gap_beams", "max_gap_beams", "min_width_m", "max_width_m", "min_top_m", "max_top_m"),
    *("max_bottom_m", "max_diagonal_m"),
)
_PERSON_KEYS = "max_extent_m", "min_top_m", "min_height_m"
"""Fields of CarLimits and of STRIP_PERSON, in the order of Strips of cells.c."""
_PART_KEYS = "min_extent_m", "max_extent_m", "min_top_m", "max_top_m", "min_height_m"
"""Fields of SPLIT_PERSON, in the order of Rules of cells.c."""


class _GroundBuffers:
    """Constants and scratch of ground.c for one estimator."""

    def __init__(self, ground: GroundEstimator) -> None:
        grid = ground.grid
        scales = FAR_M, 1 / RING_STEP, SECTORS / 4
        slopes = ground.min_sqrt_range, ground.max_slope, ground.ramp_slope
        limits = NEAR_M, SLOPE_GAIN, NOISE_M, MAX_GAP_M, FLANK_M, ABOVE_M, BIN_M
        sectors = SECTORS, SECTORS.bit_length() - 1, FLANK_SECTORS, ground.bonnet_ring
        self.constants = _Ground(grid.rings, *sectors, *scales, *slopes, *limits)
        self.flat_m = np.ascontiguousarray(ground.flat_m.ravel())
        self.cells, self.kind = np.empty((5, grid.size + 1), np.float32), np.empty(grid.size, np.uint8)
        self.points, self.rays = np.empty((3, 0), np.float32), np.empty((4, SECTORS), np.float32)


class NativeKernels(NativeGeometryKernels, Kernels):
    """The passes in C.

    Args:
        library: the compiled library (`modt.native.library`).
        instructions: the set that it is compiled for.
    """

    def __init__(self, library: ctypes.CDLL, instructions: str) -> None:
        super().__init__(library)
        declare(library, _SIGNATURES)
        self.name = f"native ({instructions})"
        self._last_cells: tuple[Cells | None, array[int]] = None, array("Q")
        self._work, self._number = np.empty((2, 1), np.int32)
        self._strips: dict[CarLimits, Any] = {}
        self._ground: dict[GroundEstimator, _GroundBuffers] = {}

    def above_ground(
        self, ground: GroundEstimator, points: Float32, sensor_height_m: float, bounds: Float32
    ) -> tuple[Int, PointColumns, Float32, Int]:
        """(K,) rows of the points within bounds, those points, their (K,) heights above ground [m] and histogram."""
        buffers = self._ground.get(ground) or self._ground.setdefault(ground, _GroundBuffers(ground))
        if points.shape[1] < 4:
            raise ValueError(f"rows of x, y, z and reflectance are needed, not of shape {points.shape}")
        points, n = np.ascontiguousarray(points[:, :4], np.float32), len(points)
        rows, kept = np.empty(n + 1, np.int64), np.empty((5, n + 1), np.float32)
        if n > buffers.points.shape[1]:
            buffers.points = np.empty((3, n), np.float32)
        scratch, out = pointers(buffers.cells[:4], buffers.kind, buffers.points), pointers(kept)
        count = np.zeros(bins_up_to(float(bounds[1])), np.int64)
        k = self.library.modt_above_ground(
            buffers.constants, ground.grid.range_m, buffers.flat_m, sensor_height_m, points, n, scratch, buffers.rays,
            bounds, rows, out, count,
        )  # fmt: skip
        x, y, z, sqrt_range, height = kept[:, :k]
        return rows[:k], PointColumns(x, y, z, sqrt_range), height, count

    def occupied_cells(
        self, grid: SqrtRangeGrid, points: PointColumns, height: Float32
    ) -> tuple[Cells, Int, PointColumns, Int]:
        """Cells of (K,) points with (K,) heights [m], (C,) last point of each, those points, (K,) cell of each."""
        k = len(points)
        if len(self._number) < grid.side**2:
            self._number = np.empty(grid.side**2, np.int32)
        places, (entries, sample, cell) = np.empty((2, k), np.int32), np.empty((3, k), np.int64)
        heights, sampled = np.empty((2, k), np.float32), np.empty((4, k), np.float32)
        given, out, columns = self._columns(points), pointers(places, heights, entries), pointers(sampled)
        n = self.library.modt_occupied_cells(
            given, height, k, 1 / grid.step, grid.centre, grid.side, self._number, sample, columns, cell, out,
        )  # fmt: skip
        (row, column), (low, high) = places[:, :n], heights[:, :n]
        cells = Cells(row, column, low, high, entries[:n])
        return cells, sample[:n], PointColumns(*sampled[:, :n]), cell

    def cluster(
        self, clusterer: CellClusterer, cells: Cells, points: PointColumns, beam_m: Float32
    ) -> tuple[Int, ClusterSizes]:
        """(C,) cluster of each cell, given one point of each and the distance of beams there [m]; their sizes."""
        n, coarse, fine = len(cells), clusterer.coarse.side, clusterer.fine.side
        if len(self._work) < (room := 2 * fine + 15 * n + 8):
            self._work = np.empty(room, np.int32)
        limits = clusterer.max_extent_m, MIN_SPLIT_M, clusterer.max_split_sqrt_range, MIN_PERSON_POINTS
        rules = array("f", (MAX_CELL_GAP_M, MAX_CELL_GAP_BEAMS, *limits, *attrgetter(*_PART_KEYS)(SPLIT_PERSON)))
        cluster, counts = np.empty(n, np.int64), np.empty((2, 2 * n), np.int64)
        sizes, is_part = np.empty((5, 2 * n), np.float32), np.empty(2 * n, np.bool_)
        given, out = self._columns(points), pointers(counts, sizes, is_part)
        g = self.library.modt_cluster(
            rules, self._cells(cells), given, beam_m, n, coarse, fine, self._work, cluster, out
        )
        (count, cell), (extent_m, bottom_m, top_m, sqrt_range, beam_m) = counts[:, :g], sizes[:, :g]
        return cluster, ClusterSizes(count, extent_m, bottom_m, top_m, sqrt_range, cell, beam_m, is_part[:g])

    def view_bounds(self, clusters: Clusters, number: Int, n: int) -> ViewBounds:
        """Bounds of n clusters in the view, given (G,) the number of each, or NONE."""
        bounds, scale_m = np.empty((8, n), np.float32), np.empty(n, np.float32)
        cells, sampled, out = self._cells(clusters.cells), self._columns(clusters.sampled), pointers(bounds)
        self.library.modt_view_bounds(
            cells, sampled, clusters.height, clusters.sample, clusters.of_cell, len(clusters.sample), number, n, out,
            scale_m,
        )  # fmt: skip
        return ViewBounds(bounds[:4], bounds[4:], scale_m)

    def merge_strips(self, bounds: ViewBounds, beam_rad: Float32, limits: CarLimits) -> Int:
        """(G,) first of the clusters that make one car with each, given (G,) the spacing of beams there [rad]."""
        n, strips = len(bounds), self._strips.get(limits)
        if strips is None:
            values = *attrgetter(*_STRIP_KEYS)(limits), *attrgetter(*_PERSON_KEYS)(STRIP_PERSON)
            strips = self._strips[limits] = (_F * len(values))(*values)
        order, target = bounds.min[DIRECTION].argsort(kind="stable"), np.empty(n, np.int64)
        parent, united = np.empty(n, np.int32), np.empty((8, n), np.float32)
        given, out = pointers(bounds.min, bounds.max), pointers(united)
        self.library.modt_merge_strips(strips, given, bounds.scale_m, beam_rad, n, order, parent, out, target)
        return target

    def group(self, labels: Int, n: int) -> Groups:
        """Groups 0 to n - 1 of the rows with these labels; rows labelled NONE are left out."""
        rows, offsets = np.empty(len(labels), np.int64), np.empty(n + 1, np.int64)
        return Groups(rows[: self.library.modt_group(labels, len(labels), n, rows, offsets)], offsets)

    def members_of(self, clusters: Clusters, index: Int) -> Members:
        """Points of each cluster, given (K,) the row of each point in the sweep."""
        points, cells, of_cell = clusters.points, clusters.cells, clusters.of_cell
        k, offsets = len(index), np.empty(clusters.n + 1, np.int64)
        rows, own = np.empty(k, np.int64), np.empty(4 * k, np.float32)
        given, out = structure(points.x, points.y, points.z, clusters.height, index), structure(offsets, rows, own)
        self.library.modt_members(given, clusters.cell, k, of_cell, cells.entries, len(cells), clusters.n, out)
        m = int(offsets[-1])
        return Members(offsets, rows[:m], own[: 4 * m].reshape(4, m))

    def best_headings(self, x: Float32, y: Float32, groups: Groups, limit: int, noise_m: float) -> Int:
        """(G,) index of the heading whose sides the points of a group, at most `limit` of them, are closest to."""
        best = np.empty(len(groups), np.int64)
        given = x, y, groups.rows, groups.offsets, len(groups), limit
        self.library.modt_best_headings(*given, *AXES, len(HEADINGS), noise_m, best)
        return best

    def reflectance_statistics(self, points: Float32, index: Int, offsets: Int) -> Float64:
        """(G, 5) mean, standard deviation, maximum, share of bright and share of dark returns of each group."""
        points, n = np.ascontiguousarray(points, np.float32), len(offsets) - 1
        statistics = np.empty((n, N_REFLECTANCE))
        self.library.modt_reflectance_statistics(points, points.shape[1], index, offsets, n, BRIGHT, DARK, statistics)
        return statistics

    @staticmethod
    def _columns(points: PointColumns) -> array[int]:
        return structure(points.x, points.y, points.z, points.sqrt_range)

    def _cells(self, cells: Cells) -> array[int]:
        if self._last_cells[0] is not cells:
            self._last_cells = cells, structure(cells.row, cells.column, cells.low, cells.high, cells.entries)
        return self._last_cells[1]
