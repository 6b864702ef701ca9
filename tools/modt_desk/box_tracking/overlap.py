"""Overlap of upright boxes in space."""

from __future__ import annotations

import numpy as np

from modt.geometry import corners
from modt.types import Bool, Float64

TINY = 1e-9


def birds_eye_intersection(a: Float64, b: Float64) -> Float64:
    """(n,) bird's-eye area that boxes a (n, 7) share with boxes b (n, 7), row by row [m2].

    The common polygon's vertices are the corners of one inside the other and the crossings of their edges; in the
    order of their bearing from their mean they give its area.
    """
    origin = a[:, None, :2]  # near the boxes: far from it, cross products cancel
    p, q = corners(a) - origin, corners(b) - origin
    crossing, crosses = _crossings(p, q)
    vertices = np.concatenate([p, q, crossing], axis=1)
    valid = np.concatenate([_inside(p, q), _inside(q, p), crosses], axis=1)
    n = np.maximum(valid.sum(axis=1), 1)
    mean = (vertices * valid[..., None]).sum(axis=1) / n[:, None]
    local = np.where(valid[..., None], vertices - mean[:, None], 0.0)
    bearing = np.where(valid, np.arctan2(local[..., 1], local[..., 0]), np.inf)
    order = np.argsort(bearing, axis=1)
    ring = np.take_along_axis(local, order[..., None], axis=1)
    placed = np.take_along_axis(valid, order, axis=1)
    ring = np.where(placed[..., None], ring, ring[:, :1])  # the unused repeat the first vertex and add no area
    after = np.roll(ring, -1, axis=1)
    area: Float64 = 0.5 * np.abs((ring[..., 0] * after[..., 1] - ring[..., 1] * after[..., 0]).sum(axis=1))
    return area


def iou_3d(a: Float64, b: Float64) -> Float64:
    """(n,) intersection over union of the boxes' volumes, row by row."""
    top = np.minimum(a[:, 2] + a[:, 5] / 2, b[:, 2] + b[:, 5] / 2)
    foot = np.maximum(a[:, 2] - a[:, 5] / 2, b[:, 2] - b[:, 5] / 2)
    shared = birds_eye_intersection(a, b) * np.maximum(top - foot, 0.0)
    union = np.prod(a[:, 3:6], axis=1) + np.prod(b[:, 3:6], axis=1) - shared
    iou: Float64 = shared / np.maximum(union, TINY)
    return iou


def _inside(points: Float64, polygon: Float64) -> Bool:
    """(n, k) whether points (n, k, 2) lie in counter-clockwise rectangles (n, 4, 2), edges included."""
    edge = np.roll(polygon, -1, axis=1) - polygon
    offset = points[:, :, None] - polygon[:, None]
    cross = edge[:, None, :, 0] * offset[..., 1] - edge[:, None, :, 1] * offset[..., 0]
    inside: Bool = np.logical_and.reduce(cross >= -TINY, axis=2)
    return inside


def _crossings(p: Float64, q: Float64) -> tuple[Float64, Bool]:
    """(n, 16, 2) where the edges of p meet those of q, and whether they do so within both."""
    d, e = np.roll(p, -1, axis=1) - p, np.roll(q, -1, axis=1) - q
    offset = q[:, None] - p[:, :, None]
    d, e = d[:, :, None], e[:, None]
    denominator = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    parallel = np.less(np.abs(denominator), TINY)
    denominator = np.where(parallel, 1.0, denominator)
    t = (offset[..., 0] * e[..., 1] - offset[..., 1] * e[..., 0]) / denominator
    u = (offset[..., 0] * d[..., 1] - offset[..., 1] * d[..., 0]) / denominator
    meets = ~parallel & (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
    point = p[:, :, None] + t[..., None] * d
    return point.reshape(len(p), 16, 2), meets.reshape(len(p), 16)
