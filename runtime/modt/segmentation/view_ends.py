"""Sides at which a proposal ends because the view of the sensor ends."""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.placement import Mount
from modt.types import Cut, Float32, Float64, Int

_STEPS, _NEAR_M, _TILTED_M = 0.75, 0.1, 8.0
"""A proposal is cut this near to the outermost beam [beam spacings], beyond which none passes, and range used [m]; by
a tilted sensor as far away as the last [m], since the models of what is cut know nothing farther away."""


class ViewEnds:
    """Tells which sides of proposals are cut, above as far away as the highest beam is below `max_height_m`."""

    def __init__(self, sensor: SensorConfig, max_height_m: float) -> None:
        R_level_sensor = Mount.of(sensor.roll_deg, sensor.pitch_deg).R_level_sensor
        self._R_sensor_level = None if R_level_sensor is None else R_level_sensor.T.astype(np.float32)
        upright = R_level_sensor is None or R_level_sensor[2, 2] > 0
        self._lowest, self._highest = (Cut.BOTTOM, Cut.TOP) if upright else (Cut.TOP, Cut.BOTTOM)
        sectors = np.deg2rad(sensor.blind_sectors_deg or ())
        self._edges = np.stack([np.cos(sectors), np.sin(sectors)], axis=1).astype(np.float32)
        self._edge_tangent, self._near_m = (
            np.tan(np.deg2rad(2 * sensor.azimuth_step_deg)),
            sensor.min_range_m + _NEAR_M,
        )
        self._blind_m = sensor.blind_range_m * bool(len(sectors))
        self._reach_m, self._tangents = max(self._near_m, self._blind_m), np.array([-np.inf, np.inf])
        if sensor.span_deg is not None:
            span, outward = np.deg2rad(sensor.span_deg), np.array([-1.0, 1.0])
            ends, mount_m = np.tan(span), sensor.height_m or 0.0
            tilt = 0.0 if R_level_sensor is None else np.arccos(abs(R_level_sensor[2, 2]))
            beyond_m = np.array([mount_m, max_height_m - mount_m])
            reach_m, tilted_m = (beyond_m / np.maximum(np.tan(outward * span - by), 1e-3) for by in (0.0, tilt))
            self._reach_m = max(self._reach_m, *reach_m, *np.minimum(tilted_m, _TILTED_M))
            self._tangents = ends - outward * _STEPS * sensor.beams.step_rad(ends.astype(np.float32))

    def cut(self, coordinates: Float32, offsets: Int, box: Float64) -> Int:
        """(P,) flags of Cut, of proposals that own (3, K) level points by (P + 1,) offsets, in (P, 7) boxes."""
        cut, nearest_m = np.zeros(len(box), np.int64), np.hypot(*box[:, :2].T) - np.hypot(*box[:, 3:5].T) / 2
        near = (nearest_m < self._reach_m).nonzero()[0]  # farther away the beams pass beyond people
        if not len(near):
            return cut
        runs = zip(offsets[near].tolist(), offsets[near + 1].tolist(), strict=True)
        xyz = np.concatenate([coordinates[:, first:end] for first, end in runs], axis=1)
        x, y, z = xyz if self._R_sensor_level is None else self._R_sensor_level @ xyz
        count = (offsets[1:] - offsets[:-1])[near]
        starts, range_m = count.cumsum() - count, np.sqrt(x * x + y * y)  # a fifth of the time of hypot
        tangent = z / np.maximum(range_m, np.float32(1e-3))
        flags = Cut.NEAR * (np.minimum.reduceat(range_m, starts) < self._near_m).astype(np.int64)
        flags |= self._lowest * (np.minimum.reduceat(tangent, starts) < self._tangents[0])
        flags |= self._highest * (np.maximum.reduceat(tangent, starts) > self._tangents[1])
        for c, s in self._edges:
            along, across = c * x + s * y, c * y - s * x
            at_edge = (np.abs(across) < self._edge_tangent * along) & (range_m < self._blind_m)
            flags |= Cut.SIDE * np.maximum.reduceat(at_edge, starts)
        cut[near] = flags
        return cut
