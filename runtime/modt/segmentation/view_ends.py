"""Sides at which a proposal ends because the view of the sensor ends."""

from __future__ import annotations

import numpy as np

from modt.config import SensorConfig
from modt.placement import Mount
from modt.segmentation.tuning import ViewEndTuning
from modt.types import Cut, Float32, Float64, Int


class ViewEnds:
    """Tells which sides of proposals are cut. Above, that ends where the highest beam has risen to `max_height_m`.

    Args:
        sensor: mount, beams, nearest range and blind sectors.
        max_height_m: height above ground of what is looked for.
        tuning: distances to the ends of the view within which a proposal is cut.
    """

    def __init__(self, sensor: SensorConfig, max_height_m: float, tuning: ViewEndTuning = ViewEndTuning()) -> None:
        R_level_sensor = Mount.of(sensor.roll_deg, sensor.pitch_deg).R_level_sensor
        self._R_sensor_level = None if R_level_sensor is None else R_level_sensor.T.astype(np.float32)
        upright_share = 1.0 if R_level_sensor is None else R_level_sensor[2, 2]  # cosine of the tilt
        self._at_lowest = Cut.BOTTOM if upright_share > 0 else Cut.TOP
        self._at_highest = Cut.TOP if upright_share > 0 else Cut.BOTTOM
        self._near_m = sensor.min_range_m + tuning.near_m
        # (E, 2) directions of the edges of blind sectors, and tangent of the widest angle from one to a return at it.
        edges_rad = np.deg2rad(sensor.blind_sectors_deg or ())
        self._edges = np.stack([np.cos(edges_rad), np.sin(edges_rad)], axis=1).astype(np.float32)
        self._edge_tangent = np.tan(np.deg2rad(2 * sensor.azimuth_step_deg))
        self._blind_m = sensor.blind_range_m * bool(len(edges_rad))
        self._reach_m = max(self._near_m, self._blind_m)
        self._tangents = np.array([-np.inf, np.inf])
        if sensor.span_deg is not None:
            # Below the lowest beam the sensor's own height is hidden, above the highest one the rest of a person. The
            # beam passes beyond both at the range where it has fallen, or risen, by that much.
            outward = np.array([-1.0, 1.0])  # the lowest beam, and the highest
            span_rad = np.deg2rad(sensor.span_deg)
            tangents = np.tan(span_rad)
            sensor_m = sensor.height_m or 0.0
            hidden_m = np.array([sensor_m, max_height_m - sensor_m])
            tilt_rad = np.arccos(abs(upright_share))
            level_reach_m, tilted_reach_m = (
                hidden_m / np.maximum(np.tan(outward * span_rad - by_rad), 1e-3) for by_rad in (0.0, tilt_rad)
            )
            self._reach_m = max(self._reach_m, *level_reach_m, *np.minimum(tilted_reach_m, tuning.tilted_m))
            beam_tangent = sensor.beams.step_rad(tangents.astype(np.float32))
            self._tangents = tangents - outward * tuning.beam_steps * beam_tangent

    def cut(self, coordinates: Float32, offsets: Int, box: Float64) -> Int:
        """(P,) flags of Cut, of proposals that own (3, K) level points by (P + 1,) offsets, in (P, 7) boxes."""
        cut = np.zeros(len(box), np.int64)
        nearest_m = np.hypot(*box[:, :2].T) - np.hypot(*box[:, 3:5].T) / 2
        near = (nearest_m < self._reach_m).nonzero()[0]  # farther away the beams pass beyond people
        if len(near):
            runs = zip(offsets[near].tolist(), offsets[near + 1].tolist(), strict=True)
            xyz = np.concatenate([coordinates[:, first:end] for first, end in runs], axis=1)
            count = (offsets[1:] - offsets[:-1])[near]
            cut[near] = self._cut_near(xyz, count.cumsum() - count)
        return cut

    def _cut_near(self, xyz: Float32, starts: Int) -> Int:
        """(P,) flags of proposals near enough to be cut, by (3, K) level points; proposal i begins at starts[i]."""
        x, y, z = xyz if self._R_sensor_level is None else self._R_sensor_level @ xyz
        range_m = np.sqrt(x * x + y * y)  # a fifth of the time of hypot
        tangent = z / np.maximum(range_m, np.float32(1e-3))
        flags = Cut.NEAR * (np.minimum.reduceat(range_m, starts) < self._near_m).astype(np.int64)
        flags |= self._at_lowest * (np.minimum.reduceat(tangent, starts) < self._tangents[0])
        flags |= self._at_highest * (np.maximum.reduceat(tangent, starts) > self._tangents[1])
        for cosine, sine in self._edges:
            along = cosine * x + sine * y
            across = cosine * y - sine * x
            at_edge = (np.abs(across) < self._edge_tangent * along) & (range_m < self._blind_m)
            flags |= Cut.SIDE * np.maximum.reduceat(at_edge, starts)
        return flags
