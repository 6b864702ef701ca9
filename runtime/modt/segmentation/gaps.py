"""Gaps that dead beams leave in the view. What stands may reach across, unseen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from modt.segmentation.grids import PointColumns
from modt.types import Float32

NO_GAPS: Float32 = np.empty((0, 4), np.float32)
EDGE, FIRST, LAST, TOP = range(4)
"""Columns of gaps: lower edge of the beam below, lowest and highest dead beam, upper edge of the beam above."""


def gaps_of(elevations_deg: Sequence[float], dead_deg: Sequence[float]) -> Float32:
    """(n, 4) gaps, as tangents of elevations. Dead beams side by side are one; the outermost beams leave none.

    Args:
        elevations_deg: elevations of all beams, ascending.
        dead_deg: those of the dead ones.
    """
    tangent = np.tan(np.deg2rad(elevations_deg))
    middle = np.concatenate([tangent[:1], (tangent[1:] + tangent[:-1]) / 2, tangent[-1:]])  # of neighbours
    alive = np.flatnonzero(~np.isin(elevations_deg, dead_deg)).tolist()
    gaps = [
        (middle[below], tangent[below + 1], tangent[above - 1], middle[above + 1])
        for below, above in pairwise(alive)
        if above > below + 1
    ]
    return np.array(gaps, np.float32).reshape(-1, 4)


def unseen_m(gaps: Float32, points: PointColumns) -> Float32:
    """(N,) height of the part of a gap that is next to each point, which what stands there may fill [m]."""
    range_m = points.sqrt_range * points.sqrt_range
    unseen: Float32 = np.zeros(len(points), np.float32)
    for gap in gaps:
        edge_m, first_m, last_m, top_m = (range_m * tangent for tangent in gap)
        below = (points.z > edge_m) & (points.z < first_m)
        above = (points.z > last_m) & (points.z < top_m)
        unseen[below] = (last_m - points.z)[below]
        unseen[above] = (points.z - first_m)[above]
    return unseen
