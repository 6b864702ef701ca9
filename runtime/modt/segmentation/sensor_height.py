"""Height of a sensor above the floor."""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.segmentation.grids import SECTORS, PointColumns, PolarGrid
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.tuning import PolarGridTuning, SensorHeightTuning
from modt.types import Float32


class HeightEstimator:
    """Mode of the depths of flat cells around the sensor, median over the first sweeps.

    Cells on walls are excluded, since they are not flat: indoors they outnumber the cells on the floor.

    Args:
        sensor: range and beam spacing.
        tuning: which cells are used, and how many are a floor.
        polar: cells of the polar grid.
    """

    def __init__(
        self,
        sensor: SensorConfig,
        tuning: SensorHeightTuning = SensorHeightTuning(),
        polar: PolarGridTuning = PolarGridTuning(),
    ) -> None:
        self.tuning = tuning
        max_range_m = min(tuning.max_range_m, sensor.max_range_m)
        self.min_sqrt_range = np.sqrt(sensor.min_range_m)
        self.max_sqrt_range = np.sqrt(max_range_m)
        self.grid = PolarGrid(max_range_m, polar)
        self.flat_m = np.repeat(self.grid.flat_m, SECTORS)
        range_m = np.repeat(self.grid.range_m, SECTORS).astype(np.float64)
        level_step_rad = float(sensor.beams.step_rad(np.zeros(1, np.float32)).item())
        self.horizon_m = tuning.horizon_beams * level_step_rad * range_m
        self.estimates_m: list[float] = []

    def height_m(self, points: Float32) -> float:
        """Median of the estimates of the first sweeps, this (N, 4) one included; the default before any [m]."""
        if len(self.estimates_m) < self.tuning.sweeps:
            estimate = self._estimate(PointColumns.from_array(points))
            if estimate is not None:
                self.estimates_m.append(estimate)
        return float(np.median(self.estimates_m)) if self.estimates_m else self.tuning.default_m

    def _estimate(self, points: PointColumns) -> float | None:
        """Depth of the floor below the sensor in one sweep [m], None without one."""
        bin_m = self.tuning.bin_m
        used = (points.sqrt_range > self.min_sqrt_range) & (points.sqrt_range < self.max_sqrt_range)
        around = points.take(np.flatnonzero(used))
        cell = self.grid.cell(around)
        lowest = label_min(around.z, cell, self.grid.size)
        highest = label_max(around.z, cell, self.grid.size)
        flat = (highest - lowest < self.flat_m) & (-lowest > self.horizon_m)
        depth = -lowest[flat].astype(np.float64)
        cells = np.bincount((depth / bin_m).astype(np.int64), minlength=1)
        in_three_bins = np.convolve(cells, np.ones(3, np.int64), mode="same")
        if in_three_bins.max() < self.tuning.min_cells:
            return None
        mode = (int(np.argmax(in_three_bins)) + 0.5) * bin_m
        return float(depth[np.abs(depth - mode) < 1.5 * bin_m].mean())
