"""The passes over points, cells and groups that segmentation consists of."""

from __future__ import annotations

import numpy as np

from modt.geometry.kernels import GeometryKernels
from modt.segmentation.ceiling import histogram
from modt.segmentation.clusters import CellClusterer, members_of, occupied_cells
from modt.segmentation.grids import PointColumns
from modt.segmentation.ground import GroundEstimator
from modt.segmentation.groups import Groups, best_headings, reflectance_statistics
from modt.segmentation.strips import merge_strips, view_bounds
from modt.types import Float32, Int


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
        self, ground: GroundEstimator, points: Float32, sensor_height_m: float, bounds: Float32
    ) -> tuple[Int, PointColumns, Float32, Int]:
        """(K,) rows of (N, 4) or wider points within bounds, those points, their (K,) heights above ground [m].

        With them comes the histogram of the heights in which a ceiling shows.
        Bounds are the least and greatest height [m], and the least and greatest square root of range, exclusively.
        """
        sweep = PointColumns.from_array(points)
        height = ground.height_above(sweep, sensor_height_m)
        low, high, near, far = bounds
        mask = (height > low) & (height < high)
        mask &= (sweep.sqrt_range > near) & (sweep.sqrt_range < far)
        rows = np.flatnonzero(mask)
        height = height.take(rows)
        return rows, sweep.take(rows), height, histogram(height, float(high))


NUMPY = Kernels()
