"""Minimum bounding boxes of all clusters at once."""

from __future__ import annotations

import numpy as np

from modt.segmentation.groups import Groups
from modt.types import Float32, Int

HEADINGS = np.deg2rad(np.arange(0, 90, 5.0))
"""Candidates [rad]."""
_AXES = np.append(HEADINGS, HEADINGS + np.pi / 2)
AXES: Float32 = np.stack([np.cos(_AXES), np.sin(_AXES)]).astype(np.float32)
"""(2, 2 H) cosines and sines of the headings, then of what lies across them."""


def best_headings(x: Float32, y: Float32, groups: Groups, limit: int, noise_m: float) -> Int:
    """(G,) index of the heading of the rectangle whose sides the points of a group are closest to.

    Closeness, the sum of 1 / distance to the nearest side, finds the legs of the L that a car shows; the least area
    does not.

    Args:
        x: (K,) points [m].
        y: (K,) points [m].
        groups: groups of the points.
        limit: points of a group that are used, at a constant stride.
        noise_m: distance within which a point lies on a side [m].
    """
    groups = groups.subsample(limit)
    across = AXES[0][:, None] * x.take(groups.rows)
    across += AXES[1][:, None] * y.take(groups.rows)
    inward = across - groups.broadcast(groups.min(across))
    np.minimum(inward, groups.broadcast(groups.max(across)) - across, out=inward)
    nearest = np.minimum(inward[: len(HEADINGS)], inward[len(HEADINGS) :])
    closeness = 1 / np.maximum(nearest, np.float32(noise_m))
    best: Int = np.argmax(np.add.reduceat(closeness, groups.offsets[:-1], axis=1, dtype=np.float64), axis=0)
    return best
