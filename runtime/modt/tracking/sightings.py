"""What a frame's proposals show, in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry import transform, transform_boxes
from modt.types import Bool, Float64, Frame, Int, Proposals

DIRECTIONS = np.deg2rad([0.0, 45.0, 90.0, 135.0])
"""Bearings of the axes along which an outline is measured, world frame [rad]."""
AXES = np.stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])


@dataclass(frozen=True, slots=True)
class Sightings:
    """The proposals of a frame in the world; P rows.

    Attributes:
        box: (P, 7) world frame.
        centroid: (P, 2) mean of the points [m].
        low, high: (P, 4) outline: least and greatest coordinate of the points along each of AXES [m].
        foot, top: (P,) heights of the lowest and the highest point [m].
        count: (P,) points.
        range_m: (P,) distance from the sensor.
        cut: (P,) the outline is cut short by the field of view or by something in front.
        eye: (2,) where the sensor stands [m].
    """

    box: Float64
    centroid: Float64
    low: Float64
    high: Float64
    foot: Float64
    top: Float64
    count: Int
    range_m: Float64
    cut: Bool
    eye: Float64

    def __len__(self) -> int:
        return len(self.box)

    @property
    def place(self) -> Float64:
        """(P, 2) middle of the outline along x and y [m]."""
        middle: Float64 = (self.low[:, [0, 2]] + self.high[:, [0, 2]]) / 2
        return middle


def sight(frame: Frame, proposals: Proposals, T_world_sensor: Float64) -> Sightings:
    """The proposals of a frame, taken to the world by T_world_sensor (4, 4)."""
    low, high = outlines(frame, proposals, T_world_sensor)
    box = transform_boxes(T_world_sensor, proposals.box)
    return Sightings(
        box=box,
        centroid=transform(T_world_sensor, proposals.centroid)[:, :2],
        low=low,
        high=high,
        foot=box[:, 2] - box[:, 5] / 2,
        top=box[:, 2] + box[:, 5] / 2,
        count=proposals.count,
        range_m=np.hypot(proposals.centroid[:, 0], proposals.centroid[:, 1]),
        cut=proposals.truncated | proposals.occluded,
        eye=T_world_sensor[:2, 3],
    )


def outlines(frame: Frame, proposals: Proposals, T_world_sensor: Float64) -> tuple[Float64, Float64]:
    """(P, 4) least and (P, 4) greatest coordinate of each proposal's points along AXES, world frame [m]."""
    if not len(proposals):
        return np.zeros((0, len(DIRECTIONS))), np.zeros((0, len(DIRECTIONS)))
    toward = AXES.T @ T_world_sensor[:2, :3]  # (4, 3): an axis of the world, as the sensor sees it
    points = frame.points[proposals.members, :3]
    along = np.ascontiguousarray((points @ toward.T.astype(np.float32)).T)
    shift = AXES.T @ T_world_sensor[:2, 3]
    starts = proposals.offsets[:-1]
    low = np.minimum.reduceat(along, starts, axis=1).T + shift
    high = np.maximum.reduceat(along, starts, axis=1).T + shift
    return low.astype(np.float64), high.astype(np.float64)
