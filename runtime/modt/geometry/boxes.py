"""Upright boxes: x, y, z of the centre, length, width, height [m], yaw [rad]."""

from __future__ import annotations

import numpy as np

from modt.geometry.transforms import transform, wrap, yaw_of
from modt.types import Float64


def transform_boxes(T: Float64, boxes: Float64) -> Float64:
    """(n, 7) boxes taken by the (4, 4) transform; they stay upright."""
    out = boxes.copy()
    out[:, :3] = transform(T, boxes[:, :3])
    out[:, 6] = wrap(boxes[:, 6] + yaw_of(T))
    return out


def upright_box(xyz: Float64, yaw: float) -> Float64:
    """(7,) x, y, z of the centre, l >= w, h [m], yaw [rad] of the box about (3, n) points, at a heading or across."""
    c, s = np.cos(yaw), np.sin(yaw)
    sides = np.stack([xyz[0] * c + xyz[1] * s, xyz[1] * c - xyz[0] * s, xyz[2]])
    low, high = sides.min(axis=1), sides.max(axis=1)
    (u, v, w), (length, width, tall) = (low + high) / 2, high - low
    if length < width:
        length, width, yaw = width, length, yaw - np.pi / 2
    return np.array([u * c - v * s, u * s + v * c, w, length, width, tall, yaw])


def corners(boxes: Float64) -> Float64:
    """(n, 4, 2) bird's-eye corners of (n, 7) boxes, counter-clockwise."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    local = signs * boxes[:, None, 3:5]
    c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    x = c * local[..., 0] - s * local[..., 1] + boxes[:, None, 0]
    y = s * local[..., 0] + c * local[..., 1] + boxes[:, None, 1]
    return np.stack([x, y], axis=-1)
