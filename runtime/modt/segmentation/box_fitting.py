"""Minimum bounding boxes of all clusters at once."""

from __future__ import annotations

import numpy as np

from modt.segmentation.groups import Groups
from modt.types import Float32, Float64

HEADINGS = np.deg2rad(np.arange(0, 90, 5.0))
"""Candidates [rad]."""
_AXES = np.append(HEADINGS, HEADINGS + np.pi / 2)


def fit_headings(x: Float32, y: Float32, groups: Groups, noise_m: float) -> Float64:
    """(G,) heading of the rectangle whose sides the points of a group are closest to, in [0, 90) degrees [rad].

    Closeness, the sum of 1 / distance to the nearest side, finds the legs of the L that a car shows; the least area
    does not.

    Args:
        x: (K,) points sorted by group [m].
        y: (K,) points sorted by group [m].
        groups: groups of the points.
        noise_m: distance within which a point lies on a side [m].
    """
    across = np.stack([np.cos(_AXES), np.sin(_AXES)], axis=1).astype(np.float32) @ np.stack([x, y])
    inward = across - groups.broadcast(groups.min(across))
    np.minimum(inward, groups.broadcast(groups.max(across)) - across, out=inward)
    nearest = np.minimum(inward[: len(HEADINGS)], inward[len(HEADINGS) :])
    closeness = np.add.reduceat(1 / np.maximum(nearest, np.float32(noise_m)), groups.offsets[:-1], axis=1)
    best: Float64 = HEADINGS[np.argmax(closeness, axis=0)]
    return best
