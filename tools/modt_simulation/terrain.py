"""The ground: a grid of heights and materials, and its intersection with rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modt.types import Float32, Float64, Int
from modt_simulation.raycast import RayCaster

UInt8 = NDArray[np.uint8]

NEAREST_M = 0.5
"""Nearest distance along a ray at which it is compared with the ground."""
N_DISTANCES = 90
"""Number of these distances, each 6 % longer than the one before."""
N_HALVINGS = 6
"""Number of bisections of the interval in which a ray meets the ground."""
STEEPEST = 0.1
"""Tangent of the rays that may meet the rising ground of streets."""


@dataclass(frozen=True)
class Terrain:
    """Heights and materials on a square grid, constant beyond its border."""

    corner: Float64  # (2,) of the first cell [m, world]
    cell_m: float  # side of a cell
    height: Float32  # (X, Y) height of the ground [m, world]
    surface: UInt8  # (X, Y) its Material
    steepest: float = STEEPEST  # tangent of the rays that may meet it where it rises

    def cells(self, x: Float32, y: Float32) -> Int:
        """Flat index of the cell under each point."""
        scale = np.float32(1 / self.cell_m)
        i = ((x - np.float32(self.corner[0])) * scale).astype(np.int32)
        j = ((y - np.float32(self.corner[1])) * scale).astype(np.int32)
        np.minimum(np.maximum(i, 0, out=i), self.height.shape[0] - 1, out=i)
        np.minimum(np.maximum(j, 0, out=j), self.height.shape[1] - 1, out=j)
        return np.asarray(i * self.height.shape[1] + j)

    def heights(self, x: Float64, y: Float64) -> Float64:
        """(n,) height of the ground under each point [m, world]."""
        cell = self.cells(x.astype(np.float32), y.astype(np.float32))
        return np.asarray(self.height.ravel()[cell], np.float64)

    def cast(self, caster: RayCaster, T_world_sensor: Float64) -> tuple[Float32, UInt8]:
        """(B, A) horizontal distance to the ground [m], infinite where a ray misses it, and its material."""
        sensor = caster.sensor
        distance = np.full(sensor.shape, np.inf, np.float32)
        surface = np.zeros(sensor.shape, np.uint8)
        tilt = np.hypot(*T_world_sensor[2, :2]) / max(T_world_sensor[2, 2], 1e-9)  # infinite upside down
        low = np.flatnonzero(caster.tangent[:, 0] < (self.steepest if tilt < STEEPEST else self.steepest + tilt))
        if not len(low):
            return distance, surface
        rows = slice(int(low[0]), int(low[-1]) + 1)
        R = T_world_sensor[:3, :3].astype(np.float32)
        t = T_world_sensor[:3, 3].astype(np.float32)
        # components of the rays in the world: of their horizontal parts, and whole
        across = [R[i, 0] * caster.cos + R[i, 1] * caster.sin for i in range(3)]
        direction = [across[i] + R[i, 2] * caster.tangent[rows] for i in range(3)]
        start = [t[i] + R[i, 2] * caster.origin[rows] for i in range(3)]
        # Where the rays of a column would start if the sensor were level: wherever a ray meets the ground, it has
        # fallen about as far as the sensor is high.
        height = self.height.ravel()
        foot = t + R[:, 2] * (height[self.cells(t[:1], t[1:2])] - t[2])
        series = np.geomspace(NEAREST_M, sensor.max_range_m, N_DISTANCES, dtype=np.float32)
        first_below = np.full(direction[2].shape, N_DISTANCES)
        for k in reversed(range(N_DISTANCES)):
            ground = height[self._cells_along(foot, across, series[k])]
            np.copyto(first_below, k, where=start[2] + series[k] * direction[2] < ground)
        # The ray meets the ground between the first distance at which it is below and the one before.
        ends = np.concatenate([np.zeros(1, np.float32), series, series[-1:]])
        met, cell = self._bisected(start, direction, ends[first_below], ends[first_below + 1])
        distance[rows] = np.where(first_below < N_DISTANCES, met, np.inf)
        surface[rows] = self.surface.ravel()[cell]
        return distance, surface

    def _bisected(
        self, start: Sequence[Float32], direction: Sequence[Float32], near: Float32, far: Float32
    ) -> tuple[Float32, Int]:
        """Distances at which rays meet the ground between two distances each, and the cells."""
        for _ in range(N_HALVINGS):
            middle = ((near + far) / 2).astype(np.float32, copy=False)
            cell = self._cells_along(start, direction, middle)
            below = start[2] + middle * direction[2] < self.height.ravel()[cell]
            near = np.where(below, near, middle)
            far = np.where(below, middle, far)
        return far, cell

    def _cells_along(self, start: Sequence[Float32], direction: Sequence[Float32], s: Float32) -> Int:
        """Flat index of the cell under the points at distances s along rays."""
        return self.cells(start[0] + s * direction[0], start[1] + s * direction[1])
