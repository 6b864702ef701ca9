"""How far tracks went: what both of their ends show, since a changing view moves one of them alone."""

from __future__ import annotations

import math

import numpy as np

from modt.geometry.kdop import widths
from modt.tracking.track_table import TrackTable
from modt.types import Int

LAG_S = 1.5
"""Time constant of the place that a displacement is measured from."""


def observe_motion(tracks: TrackTable, rows: Int, dt_s: float) -> None:
    """Write displacement, time of observation and length of the rows, seen dt_s after the frame before.

    The place that a track comes from follows its k-DOP with a lag: at a constant speed v the displacement tends to
    v * LAG_S. Along each axis it is that of the end that moved less, and nothing where the ends moved apart.
    """
    lagged = tracks.lagged_kdop.take(rows, axis=0)
    shift = tracks.kdop.take(rows, axis=0) - lagged
    ahead, behind = shift[:, :4], -shift[:, 4:]
    together = np.where(ahead * behind > 0, np.minimum(np.abs(ahead), np.abs(behind)), 0.0)
    tracks.moved_m[rows] = together.max(axis=1, initial=0.0)
    tracks.observed_s[rows] += dt_s
    tracks.length_m[rows] = widths(tracks.envelope.take(rows, axis=0).T).max(axis=0, initial=0.0)
    tracks.lagged_kdop[rows] = lagged + (1.0 - math.exp(-dt_s / LAG_S)) * shift
