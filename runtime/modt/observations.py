"""Observations: the proposals of a frame in the world."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.geometry import transform, transform_boxes
from modt.geometry.kdop import AXES, DIRECTIONS, centres
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.placement import Placement
from modt.types import Bool, Float64, Int, Proposals

MIN_RANGE_M = 1e-3
"""Distance from the sensor within which a proposal lies in no direction [m]."""


@dataclass(frozen=True)
class Observations:
    """The proposals of a frame in the world, P rows.

    Attributes:
        box: (P, 7) world frame.
        centroid: (P, 2) mean of the points [m].
        kdop: (8, P) k-DOPs of the points, see geometry/kdop.py [m].
        bottom, top: (P,) heights of the lowest and the highest point [m].
        count: (P,) points.
        range_m: (P,) distance from the sensor.
        sensor_xy: (2,) position of the sensor [m].
    """

    box: Float64
    centroid: Float64
    kdop: Float64
    bottom: Float64
    top: Float64
    count: Int
    range_m: Float64
    sensor_xy: Float64

    def __len__(self) -> int:
        return len(self.box)

    @property
    def position(self) -> Float64:
        """(P, 2) centre of the k-DOP along x and y [m]."""
        return centres(self.kdop)[::2].T

    def sight(self, proposals: Int) -> Float64:
        """(2, K) unit vectors from the sensor to proposals (K,) [world]; zero for one at the sensor."""
        off = self.centroid.T.take(proposals, axis=1) - self.sensor_xy[:, None]
        unit: Float64 = off / np.maximum(np.sqrt(off[0] * off[0] + off[1] * off[1]), MIN_RANGE_M)
        return unit

    def moved(self, step: Float64) -> Observations:
        """The same, displaced by steps (P, 2) [m, world]."""
        box = self.box.copy()
        box[:, :2] += step
        return replace(self, box=box, centroid=self.centroid + step, kdop=self.kdop + DIRECTIONS.T @ step.T)

    def regrouped(self, source: Int, changed: Int, observed: Observations) -> Observations:
        """Observations of proposals in another grouping.

        Args:
            source: (Q,) former proposal whose observation each takes over.
            changed: (R,) those, of Q, whose members changed.
            observed: (R,) their observations.
        """

        def merged(column: str, axis: int = 0) -> NDArray[Any]:
            entries: NDArray[Any] = getattr(self, column).take(source, axis=axis)
            entries[(slice(None),) * axis + (changed,)] = getattr(observed, column)
            return entries

        return Observations(
            box=merged("box"),
            centroid=merged("centroid"),
            kdop=merged("kdop", axis=1),
            bottom=merged("bottom"),
            top=merged("top"),
            count=merged("count"),
            range_m=merged("range_m"),
            sensor_xy=self.sensor_xy,
        )


def observe(proposals: Proposals, T_world_sensor: Float64, kernels: GeometryKernels = NUMPY_GEOMETRY) -> Observations:
    """Transform the proposals of a frame to the world by T_world_sensor (4, 4)."""
    box = transform_boxes(T_world_sensor, proposals.box)
    half_m = box[:, 5] / 2
    axes = np.ascontiguousarray(T_world_sensor[:2, :3].T @ AXES, np.float32)
    ends = kernels.kdop_ends(proposals.coordinates, proposals.offsets, axes)
    return Observations(
        box=box,
        centroid=transform(T_world_sensor, proposals.centroid)[:, :2],
        kdop=ends + (T_world_sensor[:2, 3] @ DIRECTIONS)[:, None],
        bottom=box[:, 2] - half_m,
        top=box[:, 2] + half_m,
        count=proposals.count,
        range_m=np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]),
        sensor_xy=T_world_sensor[:2, 3],
    )


@dataclass(frozen=True)
class StaticTracks:
    """The tracks after a frame, as the odometry needs them, M rows in the order of their ids.

    Attributes:
        id: (M,) ascending.
        observed: (M,) seen in the last frame.
        stationary: (M,) at rest.
        candidate: (M,) a landmark, or young enough to be one, and not lost for long.
        kdop: (M, 8) last observed [m, world].
        predicted_kdop: (8, M) where the filter expects it [m, world].
    """

    id: Int
    observed: Bool
    stationary: Bool
    candidate: Bool
    kdop: Float64
    predicted_kdop: Float64


@dataclass(frozen=True)
class Located:
    """A frame in the world.

    Attributes:
        placement: pose and motion of the sensor.
        observations: the proposals, where they are at the stamp.
    """

    placement: Placement
    observations: Observations

    def __len__(self) -> int:
        return len(self.observations)
