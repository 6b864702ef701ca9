"""Estimation of the height of the sensor above the ground."""

from __future__ import annotations

import numpy as np

from modt.config import SegmentationConfig, SensorConfig
from modt.segmentation.grids import SECTORS, PolarGrid
from modt.segmentation.groups import label_max, label_min
from modt.segmentation.point_columns import PointColumns
from modt.types import Float32


class HeightEstimator:
    """Mode of the depths of flat cells around the sensor, median over the first sweeps.

    Cells on walls are excluded, since they are not flat: indoors they outnumber the cells on the floor.

    Args:
        sensor: range and beam spacing.
        config: the keys of `sensor_height`, and of `ground` those of a flat cell.
    """

    def __init__(self, sensor: SensorConfig, config: SegmentationConfig) -> None:
        self.config = c = config.sensor_height
        max_range_m = min(c.max_range_m, sensor.max_range_m)
        self.near, self.far = np.sqrt(sensor.min_range_m), np.sqrt(max_range_m)
        self.grid = PolarGrid(max_range_m)
        range_m = np.repeat(self.grid.range_m, SECTORS).astype(np.float64)
        self.flat_m = config.ground.flat_m + config.ground.flat_slope * np.repeat(self.grid.ring_width_m, SECTORS)
        self.horizon_m = c.horizon_beams * float(sensor.beams.step_rad(np.zeros(1, np.float32)).item()) * range_m
        self.estimates_m: list[float] = []

    def height_m(self, points: Float32) -> float:
        """Median of the estimates of the first sweeps, this (N, 4) one included; the default before any [m]."""
        if len(self.estimates_m) < self.config.sweeps:
            estimate = self._estimate(PointColumns.from_array(points))
            if estimate is not None:
                self.estimates_m.append(estimate)
        return float(np.median(self.estimates_m)) if self.estimates_m else self.config.default_m

    def _estimate(self, points: PointColumns) -> float | None:
        around = points.take(np.flatnonzero((points.sqrt_range > self.near) & (points.sqrt_range < self.far)))
        cell, bin_m = self.grid.cell(around), self.config.bin_m
        lowest, highest = (reduce(around.z, cell, self.grid.size) for reduce in (label_min, label_max))
        flat = (highest - lowest < self.flat_m) & (-lowest > self.horizon_m)
        depth = -lowest[flat].astype(np.float64)
        cells = np.bincount((depth / bin_m).astype(np.int64), minlength=1)
        in_three_bins = np.convolve(cells, np.ones(3, np.int64), mode="same")
        if in_three_bins.max() < self.config.min_cells:
            return None
        mode = (int(np.argmax(in_three_bins)) + 0.5) * bin_m
        return float(depth[np.abs(depth - mode) < 1.5 * bin_m].mean())
