"""Minimum bounding boxes of all clusters at once."""

from __future__ import annotations

import numpy as np

from modt.types import Float32, Float64, Int

HEADINGS = np.deg2rad(np.arange(0, 90, 5.0))


def minimum_boxes(xyz: Float32, offsets: Int) -> Float64:
    """(P, 7) upright boxes of least bird's-eye area over a fan of headings.

    Args:
        xyz: (K, 3) points grouped by cluster [m].
        offsets: (P + 1,) cluster i owns xyz[offsets[i]:offsets[i + 1]].
    """
    starts = offsets[:-1]
    c, s = np.cos(HEADINGS, dtype=np.float32), np.sin(HEADINGS, dtype=np.float32)
    along = xyz[:, :1] * c + xyz[:, 1:2] * s
    across = xyz[:, 1:2] * c - xyz[:, :1] * s
    a0, a1 = np.minimum.reduceat(along, starts), np.maximum.reduceat(along, starts)
    b0, b1 = np.minimum.reduceat(across, starts), np.maximum.reduceat(across, starts)
    best = np.argmin((a1 - a0 + 0.05) * (b1 - b0 + 0.05), axis=1)
    row = np.arange(len(starts))
    a0, a1, b0, b1 = (v[row, best].astype(np.float64) for v in (a0, a1, b0, b1))
    yaw, u, v = HEADINGS[best], (a0 + a1) / 2, (b0 + b1) / 2
    z0 = np.minimum.reduceat(xyz[:, 2], starts).astype(np.float64)
    z1 = np.maximum.reduceat(xyz[:, 2], starts).astype(np.float64)
    box = np.stack(
        [
            u * np.cos(yaw) - v * np.sin(yaw),
            u * np.sin(yaw) + v * np.cos(yaw),
            (z0 + z1) / 2,
            a1 - a0,
            b1 - b0,
            z1 - z0,
            yaw,
        ],
        axis=1,
    )
    turn = box[:, 3] < box[:, 4]
    box[turn] = box[turn][:, [0, 1, 2, 4, 3, 5, 6]] - [0, 0, 0, 0, 0, 0, np.pi / 2]
    return box
