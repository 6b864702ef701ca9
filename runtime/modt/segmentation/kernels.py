"""The passes over points, cells and groups that segmentation consists of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.geometry.kernels import GeometryKernels
from modt.segmentation.ceiling import CeilingFinder
from modt.segmentation.cells import CellClusterer, members_of, occupied_cells
from modt.segmentation.grids import PointColumns
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.groups import Groups, best_headings, reflectance_statistics
from modt.segmentation.strips import merge_strips, view_bounds
from modt.types import Float32, Int


class Bounds(NamedTuple):
    """Exclusive bounds of the points that are used."""

    min_height_m: float  # above ground
    max_height_m: float
    min_sqrt_range: float  # [sqrt(m)]
    max_sqrt_range: float


class Kernels(GeometryKernels):
    """The passes in NumPy: the reference. A subclass with compiled ones gives the same bytes."""

    name = "numpy"
    occupied_cells = staticmethod(occupied_cells)
    cluster = staticmethod(CellClusterer.cluster)
    view_bounds = staticmethod(view_bounds)
    merge_strips = staticmethod(merge_strips)
    group = staticmethod(Groups.from_labels)
    members_of = staticmethod(members_of)
    best_headings = staticmethod(best_headings)
    reflectance_statistics = staticmethod(reflectance_statistics)

    def above_ground(
        self, ground: GroundEstimator, ceiling: CeilingFinder, points: Float32, sensor_height_m: float, bounds: Bounds
    ) -> tuple[Int, PointColumns, Float32, Int]:
        """(K,) rows of (N, 4) or wider points within bounds, those points, their (K,) heights above ground [m].

        With them comes the histogram of the heights in which a ceiling shows.
        """
        sweep = PointColumns.from_array(points)
        height = ground.height_above(sweep, sensor_height_m)
        used = (height > bounds.min_height_m) & (height < bounds.max_height_m)
        used &= (sweep.sqrt_range > bounds.min_sqrt_range) & (sweep.sqrt_range < bounds.max_sqrt_range)
        rows = np.flatnonzero(used)
        height = height.take(rows)
        return rows, sweep.take(rows), height, ceiling.histogram(height)


NUMPY = Kernels()
