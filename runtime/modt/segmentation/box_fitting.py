"""Minimum bounding boxes of all clusters at once."""

from __future__ import annotations

import numpy as np

from modt.segmentation.groups import Groups
from modt.types import Float32, Float64

HEADINGS = np.deg2rad(np.arange(0, 90, 5.0))
FAN = np.append(HEADINGS, HEADINGS + np.pi / 2)
NEAREST_M = np.float32(0.1)
"""Points closer to a side than this lie on it: the noise of the sensor, and of a car's outline."""


def headings(x: Float32, y: Float32, groups: Groups) -> Float64:
    """(G,) heading of the rectangle whose sides each group's points are closest to, in [0, 90) degrees [rad].

    The least area says little about the L that a car shows of itself; the sum of 1 / distance to the nearest side
    (closeness) finds its legs.

    Args:
        x: (K,) points in the order of the groups [m].
        y: (K,) the same across [m].
        groups: what they belong to.
    """
    across = np.stack([np.cos(FAN), np.sin(FAN)], axis=1).astype(np.float32) @ np.stack([x, y])
    inward = across - groups.spread(groups.least(across))
    np.minimum(inward, groups.spread(groups.most(across)) - across, out=inward)
    nearest = np.minimum(inward[: len(HEADINGS)], inward[len(HEADINGS) :])
    closeness = np.add.reduceat(1 / np.maximum(nearest, NEAREST_M), groups.offsets[:-1], axis=1)
    best: Float64 = HEADINGS[np.argmax(closeness, axis=0)]
    return best


def upright_boxes(x: Float32, y: Float32, z: Float32, groups: Groups, yaw: Float64) -> Float64:
    """(G, 7) boxes about each group's (K,) points at the heading given, turned so that l >= w."""
    c, s = np.cos(yaw), np.sin(yaw)
    c_each, s_each = groups.spread(c.astype(np.float32)), groups.spread(s.astype(np.float32))
    sides = (x * c_each + y * s_each, y * c_each - x * s_each, z)
    low = np.stack([groups.least(side) for side in sides]).astype(np.float64)
    high = np.stack([groups.most(side) for side in sides]).astype(np.float64)
    (u, v, w), (length, width, tall) = (low + high) / 2, high - low
    turn = length < width
    return np.stack(
        [
            u * c - v * s,
            u * s + v * c,
            w,
            np.where(turn, width, length),
            np.where(turn, length, width),
            tall,
            yaw - np.where(turn, np.pi / 2, 0.0),
        ],
        axis=1,
    )
