"""Upright boxes: x, y, z of the centre, length, width, height [m], yaw [rad]."""

from __future__ import annotations

import numpy as np

from modt.geometry.transforms import transform, wrap, yaw_of
from modt.types import Float32, Float64, Int


def transform_boxes(T: Float64, boxes: Float64) -> Float64:
    """(n, 7) boxes taken by the (4, 4) transform; they stay upright."""
    out = boxes.copy()
    out[:, :3] = transform(T, boxes[:, :3])
    out[:, 6] = wrap(boxes[:, 6] + yaw_of(T))
    return out


def upright_boxes(xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
    """(G, 7) boxes at headings or across them, so that l >= w, about groups of points.

    Args:
        xyz: (3, K) points sorted by group [m].
        offsets: (G + 1,) group i owns the columns from offsets[i] to offsets[i + 1]; none is empty.
        yaw: (G,) headings [rad].
    """
    cosine, sine = np.cos(yaw), np.sin(yaw)
    count = offsets[1:] - offsets[:-1]
    c, s = (np.repeat(along.astype(np.float32), count) for along in (cosine, sine))
    x, y, z = xyz
    sides = (x * c + y * s, y * c - x * s, z)
    low, high = (
        np.stack([f.reduceat(side, offsets[:-1]) for side in sides]).astype(np.float64)
        for f in (np.minimum, np.maximum)
    )
    (u, v, w), (length, width, height) = (low + high) / 2, high - low
    turn = length < width
    longer, shorter = np.where(turn, width, length), np.where(turn, length, width)
    x, y = u * cosine - v * sine, u * sine + v * cosine
    return np.stack([x, y, w, longer, shorter, height, yaw - np.where(turn, np.pi / 2, 0.0)], axis=1)


def corners(boxes: Float64) -> Float64:
    """(n, 4, 2) bird's-eye corners of (n, 7) boxes, counter-clockwise."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    local = signs * boxes[:, None, 3:5]
    c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    x = c * local[..., 0] - s * local[..., 1] + boxes[:, None, 0]
    y = s * local[..., 0] + c * local[..., 1] + boxes[:, None, 1]
    return np.stack([x, y], axis=-1)
