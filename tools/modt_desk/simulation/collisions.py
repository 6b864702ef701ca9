"""Removal of colliding bodies from a scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modt.geometry import corners
from modt.types import Bool, Float64, Int
from modt_desk.simulation.motion import Path

STEP_S, MARGIN_M = 0.25, 0.1


def without_collisions(paths: Sequence[Path], footprint: Float64, seconds: float) -> Bool:
    """(n,) which bodies stay, by path and footprint (n, 2) [m]: of two that ever collide, the one listed first.

    Bodies of zero footprint do not collide. Pairs at rest are tested once.
    """
    solid = footprint.min(axis=1) > 0
    kept = solid.copy()
    boxes = np.zeros((len(paths), 7))
    boxes[:, 3:5] = footprint + 2 * MARGIN_M
    boxes[:, [0, 1, 6]] = [path.at(0.0) for path in paths]
    moving = np.array([not path.at_rest for path in paths])
    for step in range(int(seconds / STEP_S) + 2):
        for row in np.flatnonzero(moving & kept).tolist():
            boxes[row, [0, 1, 6]] = paths[row].at(step * STEP_S)
        first = np.flatnonzero(kept & moving) if step else np.flatnonzero(kept)
        pairs = _close_pairs(boxes, first, np.flatnonzero(kept))
        colliding = pairs[overlapping(boxes[pairs[:, 0]], boxes[pairs[:, 1]])]
        for a, b in colliding[np.argsort(colliding[:, 0], kind="stable")].tolist():
            kept[b] &= not kept[a]
    return np.asarray(kept | ~solid)


def overlapping(a: Float64, b: Float64) -> Bool:
    """(n,) whether boxes a (n, 7) and b (n, 7) overlap in the plane, by the separating axis theorem."""
    ca, cb = corners(a), corners(b)
    apart = np.zeros(len(a), np.bool_)
    for yaw in (a[:, 6], b[:, 6], a[:, 6] + np.pi / 2, b[:, 6] + np.pi / 2):
        axis = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        pa, pb = np.einsum("nkd,nd->nk", ca, axis), np.einsum("nkd,nd->nk", cb, axis)
        apart |= (pa.max(axis=1) < pb.min(axis=1)) | (pb.max(axis=1) < pa.min(axis=1))
    return ~apart


def _close_pairs(boxes: Float64, some: Int, others: Int) -> Int:
    """(p, 2) ascending pairs of rows whose circumscribed circles overlap."""
    radius = np.hypot(boxes[:, 3], boxes[:, 4]) / 2
    gap = np.hypot(*(boxes[some, None, :2] - boxes[None, others, :2]).transpose(2, 0, 1))
    i, j = np.nonzero(gap < radius[some, None] + radius[others])
    pairs = np.sort(np.stack([some[i], others[j]], axis=1), axis=1)
    return np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
