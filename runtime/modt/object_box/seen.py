"""What a frame shows of objects, and its place in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.types import Bool, Float64, Int, Proposals


@dataclass(frozen=True)
class Seen:
    """Visible parts of the R objects in a frame.

    Attributes:
        rows: (R,) rows of the track table.
        object_class: (R,) reported classes.
        proposal: (R,) proposals.
        box: (R, 7) boxes of the frame [world].
        long_side: (R, 2) unit vectors along the longer sides of the fitted rectangles [world].
        sides_m: (2, R) longer and shorter sides of these rectangles [m].
        neighbour: (R, 2) headings by which the axes of cars are guessed (`neighbour_headings`) [world].
        moving: (R,) objects that move.
        forward: (2,) unit vector of the sensor's x axis in the ground plane [world].
    """

    rows: Int
    object_class: Int
    proposal: Int
    box: Float64
    long_side: Float64
    sides_m: Float64
    neighbour: Float64
    moving: Bool
    forward: tuple[float, float]


def forward_of(T_world_sensor: Float64) -> tuple[float, float]:
    """Unit vector of the sensor's x axis in the ground plane [world]."""
    x, y = T_world_sensor[:2, 0].tolist()
    length = math.sqrt(x * x + y * y)
    return x / length, y / length


def in_sensor(heading: Float64, forward: tuple[float, float]) -> tuple[Float64, Float64]:
    """(R,) components of headings (R, 2) along the sensor's x and y axes."""
    c, s = forward
    return heading[:, 0] * c + heading[:, 1] * s, heading[:, 1] * c - heading[:, 0] * s


def in_world(seen: Seen, proposals: Proposals, position: Float64, T_world_sensor: Float64) -> Float64:
    """(R, 2) places in the world of positions (R, 2) in the sensor frame, one a proposal [m].

    They keep their distance from the box of the proposal, whose place in the world is known.
    """
    step = position - proposals.box.take(seen.proposal, axis=0)[:, :2]
    (xx, xy), (yx, yy) = T_world_sensor[:2, :2].tolist()
    x, y = step.T
    world: Float64 = seen.box[:, :2] + np.stack([xx * x + xy * y, yx * x + yy * y], axis=1)
    return world


def bottom_and_height(seen: Seen, proposals: Proposals, T_world_sensor: Float64) -> tuple[Float64, Float64]:
    """(R,) bottoms of objects that stand on the ground [m, world], and (R,) their seen heights above it [m]."""
    half_m = seen.box[:, 5] / 2
    bottom = seen.box[:, 2] - half_m
    if proposals.ground_z_m is not None:
        xz, yz, zz, z = T_world_sensor[2].tolist()
        x, y, _ = proposals.centroid.take(seen.proposal, axis=0).T
        bottom = np.minimum(bottom, xz * x + yz * y + zz * proposals.ground_z_m[seen.proposal] + z)
    return bottom, seen.box[:, 2] + half_m - bottom
