"""The ground: a grid of heights and materials, and its intersection with rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modt.simulation.raycast import RayCaster
from modt.types import Float32, Float64, Int

UInt8 = NDArray[np.uint8]

N_ITERATIONS = 3
"""Fixed-point iterations of the intersection of a ray with the ground."""


@dataclass(frozen=True)
class Terrain:
    """Heights and materials on a square grid, constant beyond its border."""

    corner: Float64  # (2,) of the first cell [m, world]
    cell_m: float  # side of a cell
    height: Float32  # (X, Y) height of the ground [m, world]
    surface: UInt8  # (X, Y) its Material

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
        """(B, A) horizontal distance to the ground [m], infinite where a ray misses it, and its material.

        Fixed-point iteration: each ray is intersected with the plane at the height below its last intersection.
        """
        sensor = caster.sensor
        distance = np.full(sensor.shape, np.inf, np.float32)
        surface = np.zeros(sensor.shape, np.uint8)
        R, t = T_world_sensor[:3, :3].astype(np.float32), T_world_sensor[:3, 3]
        low = np.flatnonzero(caster.tangent[:, 0] < 0.05)
        if not len(low):
            return distance, surface
        rows = slice(int(low[0]), int(low[-1]) + 1)
        tangent, origin = caster.tangent[rows], caster.origin[rows]
        d = [(R[i, 0] * caster.cos + R[i, 1] * caster.sin) + R[i, 2] * tangent for i in range(3)]
        start = [np.float32(t[i]) + R[i, 2] * origin for i in range(3)]
        fall = np.minimum(d[2], np.float32(-1e-4))
        height = np.float32(self.heights(t[:1], t[1:2])[0])
        reach = np.float32(sensor.max_range_m)
        inverse = 1 / fall
        s = (height - start[2]) * inverse
        flat = self.height.ravel()
        for _ in range(N_ITERATIONS):
            s = np.minimum(s, reach)
            cell = self.cells(start[0] + s * d[0], start[1] + s * d[1])
            s = (flat[cell] - start[2]) * inverse
        met = (s > 0) & (s < reach)
        distance[rows] = np.where(met, s, np.inf)
        surface[rows] = self.surface.ravel()[cell]
        return distance, surface
