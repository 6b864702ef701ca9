"""The passes of segmentation in C (`modt.native`)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Hashable
from dataclasses import fields
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from modt.geometry.native_kernels import NativeGeometryKernels
from modt.geometry.tuning import ShapeTuning
from modt.native.declarations import declare, structure
from modt.native.library import Filled, Layout
from modt.segmentation.cell_clusterer import CellClusterer
from modt.segmentation.cells import AirOfCells, Cells
from modt.segmentation.cluster_sizes import ClusterSizes
from modt.segmentation.clusters import Clusters, Members
from modt.segmentation.grids import FAR_M, SECTORS, PointColumns, SqrtRangeGrid
from modt.segmentation.ground import QUARTERS, GroundEstimator
from modt.segmentation.groups import AXES, BRIGHT, DARK, HEADINGS, Groups
from modt.segmentation.kernels import Above, Bounds, Kernels
from modt.segmentation.overhang import Overhangs
from modt.segmentation.porosity import PorosityFinder
from modt.segmentation.strips import DIRECTION, ViewBounds
from modt.segmentation.tuning import HeadTuning, StripTuning
from modt.types import N_REFLECTANCE, Bool, Float32, Float64, Int, Int8

T = TypeVar("T", Cells, PointColumns, ClusterSizes)
GROUND = structure("Ground")
ABOVE_GROUND = structure("AboveGround")
POINT_COLUMNS = structure("PointColumns")
GRID = structure("Grid")
CELLS = structure("Cells")
POROSITY_RULES = structure("PorosityRules")
NEAR_CELLS = structure("NearCells")
PERSON_SIZE = structure("PersonSize")
CLUSTER_RULES = structure("ClusterRules")
STRUCTURE_RULES = structure("StructureRules")
HEAD_TUNING = structure("HeadTuning")
CLUSTER_SIZES = structure("ClusterSizes")
VIEW_BOUNDS = structure("ViewBounds")
STRIP_RULES = structure("StripRules")
OVERHANG_RULES = structure("OverhangRules")
CLUSTERS = structure("Clusters")
MEMBERS = structure("Members")


def _from_sources(fill: Callable[..., Filled], *sources: Hashable) -> Filled:
    """Structure that a function fills."""
    return fill(*sources)


def _filled(layout: Layout, *sources: object, **others: Any) -> Filled:
    """Fill a layout.

    A member is taken from `others`, else from the first source that has an attribute of its name.
    """
    for name in layout.members.keys() - others:
        others[name] = next(getattr(source, name) for source in sources if hasattr(source, name))
    return layout(**others)


def _ground(ground: GroundEstimator, bounds: Bounds) -> Filled:
    sources = bounds, ground, ground.slopes, ground.tuning, ground.grid
    chosen = {"clear_m": ground.tuning.clear_m, "n_gaps": len(ground.gaps)}
    return _filled(GROUND, *sources, sectors=SECTORS, quarters=QUARTERS, far_m=FAR_M, **chosen)


def _clusters(clusters: Clusters) -> Filled:
    entries = clusters.cells.entries
    return CLUSTERS.of(clusters, entries=entries, n_points=len(clusters.cell_of_point), n_cells=len(entries))


def _grid(grid: SqrtRangeGrid) -> Filled:
    return GRID.of(grid, cells_per_unit=1 / grid.step, table=np.empty((grid.side, grid.side), np.int32))


def _near_cells(finder: PorosityFinder) -> Filled:
    """Empty cells around the sensor, three more than are looked at on each side."""
    reach = min(int(finder.max_sqrt_range / finder.grid.step) + 3, finder.grid.centre)
    shape = (2 * reach, 2 * reach)
    return NEAR_CELLS(
        side=2 * reach,
        first=finder.grid.centre - reach,
        returns=np.zeros(shape, np.int32),
        low=np.full(shape, np.inf, np.float32),
        high=np.full(shape, -np.inf, np.float32),
        solidity=np.zeros(shape, np.float32),
    )


def _cluster_rules(clusterer: CellClusterer) -> Filled:
    sides = {"coarse_side": clusterer.coarse.side, "fine_side": clusterer.fine.side}
    return _filled(CLUSTER_RULES, clusterer, clusterer.gap, clusterer.split, clusterer.fine, **sides)


def _structure_rules(clusterer: CellClusterer) -> Filled:
    return _filled(STRUCTURE_RULES, clusterer.structure, clusterer.kept)


class NativeKernels(NativeGeometryKernels, Kernels):
    """The passes in C.

    Args:
        library: the compiled library (`modt.native.library`).
        instructions: the set that it is compiled for.
        tuning: comparison of k-DOPs.
    """

    def __init__(self, library: ctypes.CDLL, instructions: str, tuning: ShapeTuning = ShapeTuning()) -> None:
        super().__init__(library, tuning)
        declare(library, "ground.c", "cells.c", "heads.c", "groups.c")
        self.name = f"native ({instructions})"
        # Structures filled from objects that do not change. Those of a segmenter are 14, and hold its grids.
        self._structure = lru_cache(maxsize=32)(_from_sources)
        self._scratch = np.empty(0, np.uint8)

    def above_ground(self, ground: GroundEstimator, points: Float32, sensor_height_m: float, bounds: Bounds) -> Above:
        """Those of (N, 4) or wider points within bounds."""
        if points.shape[1] < 4:
            raise ValueError(f"rows of x, y, z and reflectance are needed, not of shape {points.shape}")
        points = np.ascontiguousarray(points[:, :4], np.float32)
        n = len(points)
        structure = self._structure(_ground, ground, bounds)
        scratch = self._memory(self.library.modt_ground_scratch(structure, n))
        rows = np.empty(n + 1, np.int64)
        kept = np.empty((5, n + 1), np.float32)
        is_clear = np.empty(n + 1, np.bool_)
        top = np.empty((ground.grid.rings, SECTORS), np.float32)
        kind = np.empty(n + 1, np.int8)
        out = ABOVE_GROUND(rows=rows, kept=kept, is_clear=is_clear, top=top, kind=kind)
        counts = np.empty(2, np.int64)
        self.library.modt_above_ground(structure, points, n, sensor_height_m, scratch, out, counts)
        n_tall, n_low = counts.tolist()
        *columns, height = kept[:, : n_tall + n_low]
        return Above(rows[: n_tall + n_low], PointColumns(*columns), height, is_clear[:n_low], top, kind[:n])

    def occupied_cells(
        self, grid: SqrtRangeGrid, points: PointColumns, height: Float32
    ) -> tuple[Cells, Int, PointColumns, Int]:
        """Cells of (K,) points with (K,) heights [m], (C,) last point of each, those points, (K,) cell of each."""
        k = len(points)
        row, column, levels = np.empty((3, k), np.int32)
        low, high, *columns = np.empty((6, k), np.float32)
        entries, sample, cell_of_point = np.empty((3, k), np.int64)
        cells = Cells(row, column, levels, low, high, entries)
        sampled = PointColumns(*columns)
        n = self.library.modt_occupied_cells(
            POINT_COLUMNS.of(points),
            height,
            k,
            self._structure(_grid, grid),
            sample,
            POINT_COLUMNS.of(sampled),
            cell_of_point,
            CELLS.of(cells),
        )
        return _first(cells, n), sample[:n], _first(sampled, n), cell_of_point

    def air(self, finder: PorosityFinder, cells: Cells, sqrt_range: Float32, beam_m: Float32) -> AirOfCells:
        """Solidity of C cells."""
        n = len(cells)
        solidity = np.empty(n, np.float32)
        airborne = np.empty(n, np.bool_)
        looked_at = np.empty(1, np.int64)
        of_air = self.library.modt_air(
            self._structure(POROSITY_RULES.of, finder),
            self._structure(_near_cells, finder),
            CELLS.of(cells),
            sqrt_range,
            beam_m,
            finder.rays_sqrt_range,
            n,
            np.empty(n, np.int32),
            solidity,
            airborne,
            looked_at,
        )
        return AirOfCells(beam_m, solidity, airborne, of_air, of_air / max(int(looked_at[0]), 1))

    def mean_solidity(self, found: Clusters, label: Int, n: int) -> Float64:
        """(n,) mean solidity of the points of each label, given (C,) the label of each cell; 1 without points."""
        count, mean = np.empty((2, n))
        self.library.modt_mean_solidity(found.cells.entries, found.air.solidity, label, len(label), n, count, mean)
        return mean

    def airborne_points(self, finder: PorosityFinder, found: Clusters) -> Bool:
        """(K,) airborne points."""
        n = len(found.cells)
        n_points = len(found.height)
        is_air = np.empty(n_points, np.bool_)
        self.library.modt_airborne_points(
            self._structure(POROSITY_RULES.of, finder),
            self._structure(_grid, finder.grid),
            CELLS.of(found.cells),
            found.sampled.sqrt_range,
            found.air.beam_m,
            found.air.airborne,
            finder.rays_sqrt_range,
            n,
            found.cell_of_point,
            found.height,
            n_points,
            np.empty(n, np.int32),
            np.empty(n, np.bool_),
            np.empty(n + 1, np.int32),
            np.empty(n_points, np.int32),
            np.empty(n_points, np.float32),
            is_air,
        )
        return is_air

    def without(self, above: Above, is_air: Bool) -> Above:
        """The points without the airborne ones among the K, of a (K,) mask."""
        n = len(above.rows)
        rows = np.empty(n, np.int64)
        *columns, height = np.empty((5, n), np.float32)
        kept = self.library.modt_without(
            above.rows,
            POINT_COLUMNS.of(above.points),
            above.height_m,
            is_air,
            above.n_tall,
            n,
            above.kind,
            rows,
            POINT_COLUMNS.of(PointColumns(*columns)),
            height,
        )
        points = PointColumns(*(column[:kept] for column in columns))
        return above._replace(rows=rows[:kept], points=points, height_m=height[:kept])

    def cluster(
        self, clusterer: CellClusterer, cells: Cells, sampled: PointColumns, beam_m: Float32
    ) -> tuple[Int, ClusterSizes, Overhangs]:
        """(C,) cluster of each cell, given a point of each and the distance of beams there [m]; sizes; what hangs."""
        n = len(cells)
        scratch = self._memory(self.library.modt_cluster_scratch(n, clusterer.fine.side))
        cluster, hanging = np.empty((2, n), np.int64)
        below_m = np.empty(n, np.float32)
        count, cell = np.empty((2, 4 * n), np.int64)
        extent_m, bottom_m, top_m, sqrt_range, last_beam_m = np.empty((5, 4 * n), np.float32)
        of_oversized = np.empty(4 * n, np.bool_)
        sizes = ClusterSizes(count, cell, extent_m, bottom_m, top_m, sqrt_range, last_beam_m, of_oversized)
        g = self.library.modt_cluster(
            self._structure(_cluster_rules, clusterer),
            self._structure(_structure_rules, clusterer),
            self._structure(PERSON_SIZE.of, clusterer.split.person),
            self._structure(PERSON_SIZE.of, clusterer.split.hidden_person),
            self._structure(OVERHANG_RULES.of, clusterer.overhang),
            CELLS.of(cells),
            POINT_COLUMNS.of(sampled),
            beam_m,
            n,
            scratch,
            cluster,
            CLUSTER_SIZES.of(sizes),
            below_m,
            hanging,
        )
        return cluster, _first(sizes, g), Overhangs(below_m, hanging)

    def find_people(
        self, x: Float32, y: Float32, low: Float32, high: Float32, entries: Int, tuning: HeadTuning
    ) -> Int:
        """(m,) person to whom each cell of one cluster belongs, NONE where it is nobody's."""
        m = len(x)
        peaks, person_of_peak, person = np.empty((3, m), np.int64)
        reach_m2 = np.empty(m)
        rules = self._structure(HEAD_TUNING.of, tuning)
        self.library.modt_find_people(rules, x, y, low, high, entries, m, peaks, person_of_peak, reach_m2, person)
        return person

    def view_bounds(self, clusters: Clusters, strip_of_cluster: Int, n: int) -> ViewBounds:
        """Bounds of n strips in the view, given (G,) the number of each cluster among them, or NONE."""
        bounds = _room_for_bounds(n)
        self.library.modt_view_bounds(
            CELLS.of(clusters.cells),
            POINT_COLUMNS.of(clusters.sampled),
            clusters.height,
            clusters.sample,
            clusters.cluster_of_cell,
            len(clusters.cells),
            strip_of_cluster,
            n,
            VIEW_BOUNDS.of(bounds),
        )
        return bounds

    def merge_strips(self, bounds: ViewBounds, beam_rad: Float32, tuning: StripTuning) -> Int:
        """(G,) first of the strips that make one car with each, given (G,) the spacing of beams there [rad]."""
        n = len(bounds)
        target = np.empty(n, np.int64)
        self.library.modt_merge_strips(
            self._structure(STRIP_RULES.of, tuning),
            self._structure(PERSON_SIZE.of, tuning.person),
            self._structure(PERSON_SIZE.of, tuning.hidden_person),
            VIEW_BOUNDS.of(bounds),
            beam_rad,
            n,
            bounds.min[DIRECTION].argsort(kind="stable"),
            np.empty(n, np.int32),
            VIEW_BOUNDS.of(_room_for_bounds(n)),
            target,
        )
        return target

    def group(self, labels: Int, n: int) -> Groups:
        """Groups 0 to n - 1 of the rows with these labels; rows labelled NONE are left out."""
        rows = np.empty(len(labels), np.int64)
        offsets = np.empty(n + 1, np.int64)
        return Groups(rows[: self.library.modt_group(labels, len(labels), n, rows, offsets)], offsets)

    def members_of(
        self,
        tall: Clusters,
        low: Clusters,
        places: Int,
        points: PointColumns,
        height: Float32,
        index: Int,
        kind: Int8,
    ) -> Members:
        """Points of each tall cluster, then of each low one; the kinds of the points go into (N,) `kind`."""
        k = len(index)
        offsets = np.empty(tall.n + low.n + 1, np.int64)
        rows = np.empty(k, np.int64)
        columns = np.empty((4, k), np.float32)
        self.library.modt_members(
            _clusters(tall),
            _clusters(low),
            places,
            POINT_COLUMNS.of(points),
            height,
            index,
            kind,
            MEMBERS(offsets=offsets, index=rows, columns=columns),
        )
        m = int(offsets[-1])
        return Members(offsets, rows[:m], columns.ravel()[: 4 * m].reshape(4, m))

    def low_points(
        self, grid: SqrtRangeGrid, points: PointColumns, is_clear: Bool, tall: Clusters, max_sqrt_range: float
    ) -> tuple[Int, Int]:
        """(P,) places of what may be low things or feet, and (P,) place of a tall point beside each, or NONE."""
        places, beside = np.empty((2, len(points) + 1), np.int64)
        p = self.library.modt_low_points(
            self._structure(_grid, grid),
            POINT_COLUMNS.of(points),
            is_clear,
            _clusters(tall),
            CELLS.of(tall.cells),
            tall.sampled.sqrt_range,
            tall.sample,
            len(is_clear),
            max_sqrt_range,
            np.empty(len(tall.cells), np.bool_),
            places,
            beside,
        )
        return places[:p], beside[:p]

    def best_headings(self, x: Float32, y: Float32, groups: Groups, limit: int, noise_m: float) -> Int:
        """(G,) index of the heading whose sides the points of a group, at most `limit` of them, are closest to."""
        n = len(groups)
        best = np.empty(n, np.int64)
        self.library.modt_best_headings(
            x, y, groups.rows, groups.offsets, n, limit, *AXES, len(HEADINGS), noise_m, best
        )
        return best

    def reflectance_statistics(self, points: Float32, index: Int, offsets: Int) -> Float64:
        """(G, 5) mean, standard deviation, maximum, share of bright and share of dark returns of each group."""
        points = np.ascontiguousarray(points, np.float32)
        n = len(offsets) - 1
        statistics = np.empty((n, N_REFLECTANCE))
        self.library.modt_reflectance_statistics(points, points.shape[1], index, offsets, n, BRIGHT, DARK, statistics)
        return statistics

    def _memory(self, size: int) -> NDArray[np.uint8]:
        """Scratch of at least this size [bytes], kept between calls: new pages take longer than the passes."""
        if len(self._scratch) < size:
            self._scratch = np.empty(size, np.uint8)
        return self._scratch


def _first(columns: T, n: int) -> T:
    """The first n rows of arrays that a dataclass holds."""
    return type(columns)(*(getattr(columns, f.name)[:n] for f in fields(columns)))


def _room_for_bounds(n: int) -> ViewBounds:
    """Bounds of n strips, to be filled."""
    bounds = np.empty((2, 4, n), np.float32)
    return ViewBounds(bounds[0], bounds[1], np.empty(n, np.float32))
