"""The passes over points, cells and groups that segmentation consists of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.geometry.kernels import GeometryKernels
from modt.segmentation.cell_clusterer import CellClusterer
from modt.segmentation.cells import occupied_cells
from modt.segmentation.clusters import members_of
from modt.segmentation.grids import PointColumns
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.groups import Groups, best_headings, reflectance_statistics
from modt.segmentation.heads import find_people
from modt.segmentation.low_points import low_points
from modt.segmentation.porosity import PorosityFinder, mean_solidity
from modt.segmentation.strips import merge_strips, view_bounds
from modt.types import Bool, Float32, Int, Int8, PointKind


class Bounds(NamedTuple):
    """Exclusive bounds of the points that are used."""

    min_height_m: float  # above ground
    max_height_m: float
    min_sqrt_range: float  # [sqrt(m)]
    max_sqrt_range: float


class Above(NamedTuple):
    """K of the N points of a sweep: those above the ground, within bounds of height and range.

    Then come L low ones, which lie below the least height but may belong to something.
    """

    rows: Int  # (K + L,) rows of the sweep
    points: PointColumns  # (K + L,)
    height_m: Float32  # (K + L,) above the ground
    is_clear: Bool  # (L,) low points that are clear of the roughness of the ground
    top: Float32  # (rings, SECTORS) highest return of each polar cell [m, sensor frame], -inf without any
    kind: Int8  # (N,) PointKind of all points; MEMBER of the K, GROUND of the L

    @property
    def n_tall(self) -> int:
        """K."""
        return len(self.rows) - len(self.is_clear)

    @property
    def tall(self) -> tuple[PointColumns, Float32]:
        """The K points, and (K,) heights above the ground [m]."""
        return self.points.part(0, self.n_tall), self.height_m[: self.n_tall]

    def without(self, is_air: Bool) -> Above:
        """These points without the airborne ones among the K, of a (K,) mask."""
        self.kind[self.rows.take(np.flatnonzero(is_air))] = PointKind.AIRBORNE
        kept = np.concatenate([np.flatnonzero(~is_air), np.arange(len(is_air), len(self.rows))])
        return self._replace(
            rows=self.rows.take(kept), points=self.points.take(kept), height_m=self.height_m.take(kept)
        )


class Kernels(GeometryKernels):
    """The passes in NumPy: the reference. A compiled subclass gives the same bytes, but for the last bit of a sum."""

    name = "numpy"
    occupied_cells = staticmethod(occupied_cells)
    cluster = staticmethod(CellClusterer.cluster)
    air = staticmethod(PorosityFinder.air)
    mean_solidity = staticmethod(mean_solidity)
    airborne_points = staticmethod(PorosityFinder.airborne_points)
    without = staticmethod(Above.without)
    find_people = staticmethod(find_people)
    view_bounds = staticmethod(view_bounds)
    merge_strips = staticmethod(merge_strips)
    group = staticmethod(Groups.from_labels)
    low_points = staticmethod(low_points)
    members_of = staticmethod(members_of)
    best_headings = staticmethod(best_headings)
    reflectance_statistics = staticmethod(reflectance_statistics)

    def above_ground(self, ground: GroundEstimator, points: Float32, sensor_height_m: float, bounds: Bounds) -> Above:
        """Those of (N, 4) or wider points within bounds."""
        sweep = PointColumns.from_array(points)
        height, clear_m, top = ground.heights(sweep, sensor_height_m)
        in_range = (sweep.sqrt_range > bounds.min_sqrt_range) & (sweep.sqrt_range < bounds.max_sqrt_range)
        kind = np.full(len(points), PointKind.OUT_OF_RANGE, np.int8)
        kind[in_range] = PointKind.GROUND
        kind[in_range & (height > bounds.min_height_m)] = PointKind.MEMBER
        kind[in_range & (height >= bounds.max_height_m)] = PointKind.OVERHEAD
        rows = np.flatnonzero(kind == PointKind.MEMBER)
        foot_m = np.maximum(np.float32(ground.tuning.foot_share) * clear_m, np.float32(ground.tuning.min_foot_m))
        low = np.flatnonzero((kind == PointKind.GROUND) & (height > foot_m))
        is_clear = height.take(low) > clear_m.take(low)
        rows = np.concatenate([rows, low])
        return Above(rows, sweep.take(rows), height.take(rows), is_clear, top, kind)


NUMPY = Kernels()
