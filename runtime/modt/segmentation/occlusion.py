"""Which clusters are cut by something nearer that stands in front of them."""

from __future__ import annotations

import numpy as np

from modt.segmentation.grids import pseudo_angle
from modt.segmentation.groups import Groups
from modt.types import Bool, Float32, Float64, Int

BINS = 1024
"""Directions told apart around the circle, a power of two: 0.35 degrees each."""
BESIDE = 2
"""Directions looked at beyond either side of a cluster."""
NEARER_M = 0.5
"""What hides stands at least this much nearer."""
UNSEEN_M = 1e4


def occluded(x: Float32, y: Float32, tall: Bool, groups: Groups) -> Bool:
    """(G,) whether something tall and nearer stands right beside a group, in the directions that bound it.

    Args:
        x: (C,) position of all that is raised above ground [m].
        y: (C,) the same, across [m].
        tall: (C,) high enough to hide something.
        groups: the rows that belong to each cluster.
    """
    direction = (pseudo_angle(x, y) * np.float32(BINS / 4)).astype(np.int64) & (BINS - 1)
    range_m = np.sqrt(x * x + y * y)
    nearest = np.full(BINS, UNSEEN_M, np.float32)
    np.minimum.at(nearest, direction, np.where(tall, range_m, np.float32(UNSEEN_M)))
    own, first = direction[groups.rows], direction[groups.rows[groups.offsets[:-1]]]
    turned = (own - groups.spread(first) + BINS // 2) & (BINS - 1)  # no cluster spans the seam now
    depth = range_m[groups.rows].astype(np.float64) / UNSEEN_M
    right = groups.least(turned + depth)
    left = groups.most(turned + 1 - depth)
    return _hides(nearest, first, right, -1) | _hides(nearest, first, left, 1)


def _hides(nearest: Float32, first: Int, edge: Float64, side: int) -> Bool:
    """(G,) something nearer lies just beyond an edge, given as its direction plus a fraction for its range."""
    direction = np.floor(edge).astype(np.int64)
    fraction = edge - direction
    range_m = (fraction if side < 0 else 1 - fraction) * UNSEEN_M
    beyond = direction[:, None] + side * np.arange(1, BESIDE + 1) + first[:, None] - BINS // 2
    nearer: Bool = (nearest[beyond & (BINS - 1)] < range_m[:, None] - NEARER_M).any(axis=1)
    return nearer
