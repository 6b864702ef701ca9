"""The ceiling of a room: nothing of it becomes a proposal, and it joins no objects."""

from __future__ import annotations

import numpy as np

from modt.segmentation.ground import GroundEstimator
from modt.segmentation.kernels import NUMPY, Above, Bounds, Kernels
from modt.segmentation.tuning import CeilingTuning
from modt.types import Bool, Float32


class CeilingFinder:
    """Returns of the ceiling and of what is fixed to it.

    Turned over, a ceiling is ground: it is traced outwards from above the sensor, so it may slope.

    Args:
        ground: tracing of ground.
        max_height_m: greatest height above ground at which returns are used.
        kernels: passes over points.
        tuning: when there is a ceiling, and how far objects reach below it.
    """

    def __init__(
        self,
        ground: GroundEstimator,
        max_height_m: float,
        kernels: Kernels = NUMPY,
        tuning: CeilingTuning = CeilingTuning(),
    ) -> None:
        self.ground = ground
        self.kernels = kernels
        self.tuning = tuning
        self.highest_m = max_height_m + tuning.grazed_m
        self.bounds_below = Bounds(tuning.clearance_m, np.inf, 0.0, np.inf)

    def overhead(self, points: Float32, above: Above, sensor_height_m: float) -> Bool | None:
        """(K + L,) points above the ground that belong to a ceiling, None without one.

        Args:
            points: (N, 4) or wider sweep [m, sensor frame].
            above: its points above the ground.
            sensor_height_m: height of the sensor above ground.
        """
        ceiling_m = self.height_m(above.top, sensor_height_m)
        if ceiling_m is None:
            return None
        # All that is high enough belongs to it, at first. What is clear below it stays only as a fixture.
        of_ceiling = above.height_m > self.tuning.lowest_m
        upper = of_ceiling.nonzero()[0]
        turned = points[above.rows[upper], :4] * np.array([1, 1, -1, 1], np.float32)
        below = self.kernels.above_ground(self.ground, turned, ceiling_m - sensor_height_m, self.bounds_below)
        n_below = below.n_tall
        hanging = upper[below.rows[:n_below]]
        is_fixture = below.height_m[:n_below] < self.tuning.fixture_m
        of_ceiling[hanging] = (above.height_m[hanging] > self.tuning.head_m) & is_fixture
        return of_ceiling

    def height_m(self, top: Float32, sensor_height_m: float) -> float | None:
        """Height of the ceiling above the ground at the sensor [m], None without one.

        Along a ray, the next top is about as high under a ceiling. A wall is met once, the tops of trees differ.

        Args:
            top: (rings, SECTORS) highest return of each polar cell [m, sensor frame].
            sensor_height_m: height of the sensor above ground.
        """
        tuning = self.tuning
        top = np.ascontiguousarray(top.T)  # ray by ray
        # A top below the sensor is seen from above, as a roof is.
        cell = np.flatnonzero(top > max(tuning.lowest_m - sensor_height_m, 0.0))
        if len(cell) < tuning.min_cells:
            return None
        height_m = top.ravel().take(cell) + np.float32(sensor_height_m)
        ray = cell // top.shape[1]
        goes_on = (ray[1:] == ray[:-1]) & (np.abs(np.diff(height_m)) < tuning.step_m)
        goes_on &= height_m[1:] < self.highest_m
        if np.count_nonzero(goes_on) < tuning.min_share * len(cell):
            return None
        return float(np.median(height_m[1:][goes_on]))
