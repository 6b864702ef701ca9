"""Minimum bounding boxes of all clusters at once."""

from __future__ import annotations

import numpy as np

from modt.segmentation.groups import Groups
from modt.types import Float32, Float64

HEADINGS = np.deg2rad(np.arange(0, 90, 5.0))
PAD_M = np.float32(0.05)
"""Added to each side, so that a thin line has an area to compare."""


def headings(x: Float32, y: Float32, groups: Groups) -> Float64:
    """(G,) heading of the least rectangle about each group, in [0, 90) degrees [rad].

    Args:
        x: (K,) points in the order of the groups [m].
        y: (K,) the same across [m].
        groups: what they belong to.
    """
    c, s = np.cos(HEADINGS).astype(np.float32), np.sin(HEADINGS).astype(np.float32)
    along = x[:, None] * c + y[:, None] * s
    across = y[:, None] * c - x[:, None] * s
    length = groups.most(along) - groups.least(along)
    width = groups.most(across) - groups.least(across)
    best: Float64 = HEADINGS[np.argmin((length + PAD_M) * (width + PAD_M), axis=1)]
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
