"""The tracker's own table."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.class_sizes import IS_PERSON
from modt.geometry.kdop import DIRECTIONS
from modt.types import Bool, Float64, Int, Tracks, column

ESTABLISHED_HITS = 4
"""Frames in which a track was observed, from which its velocity and class change proposals."""
LAG_S = 1.5
"""Time constant of the place that a displacement is measured from."""
GROWTH, PERSON_GROWTH, SHRINKAGE = 0.5, 0.1, 0.02
"""Weights in the size of a track: of a larger box; of a larger box of a confirmed person, who is merged with things
in passing; and of a smaller box, since the part that is hidden was seen before."""


@dataclass(slots=True)
class TrackTable(Tracks):
    """Tracks with the columns that only the tracker needs; k-DOPs as in geometry/kdop.py."""

    last_class: Int = column(int)  # when the frame began
    kdop: Float64 = column(float, 8)  # last observed [m, world]
    lagged_kdop: Float64 = column(float, 8)  # which follows the last observed with a lag [m, world]
    envelope: Float64 = column(float, 8, fill=-np.inf)  # of all observed, slowly decaying, about the position [m]
    mean_kdop: Float64 = column(float, 8)  # about the position; an end that jumped begins anew [m]
    end_variance: Float64 = column(float, 4)  # of the position along each axis, by ends that disagreed [m2]
    bottom: Float64 = column(float)  # lowest point last observed [m, world]
    top: Float64 = column(float)  # highest point last observed [m, world]
    anchor: Float64 = column(float, 2)  # position that the last k-DOP was assigned [m, world]
    rest_position: Float64 = column(float, 2)  # at which the track was last known to rest [m, world]
    stationary: Bool = column(bool)  # the track is at rest
    unseen_s: Float64 = column(float)  # since the last proposal [s]

    def predicted_kdops(self, rows: Int | slice = slice(None)) -> Float64:
        """(8, R) k-DOPs last observed of the rows, of all by default, where the filter expects them now."""
        kdop: Float64 = (self.kdop[rows] + (self.x[rows, :2] - self.anchor[rows]) @ DIRECTIONS).T.copy()
        return kdop

    def known_kdops(self, rows: Int) -> Float64:
        """(8, R) k-DOPs of all that was observed of the rows, where the filter expects them now."""
        kdop: Float64 = (self.envelope.take(rows, axis=0) + self.x.take(rows, axis=0)[:, :2] @ DIRECTIONS).T.copy()
        return kdop

    def observe_motion(self, rows: Int, dt_s: float) -> None:
        """Write displacement, time of observation and size of the rows, seen dt_s after the frame before.

        The place that a track comes from follows its k-DOP with a lag: at a constant speed v the displacement tends
        to v * LAG_S. Along each axis it is that of the end that moved less, and nothing where the ends moved apart:
        a changing view moves one of them alone.
        """
        lagged = self.lagged_kdop.take(rows, axis=0)
        shift = self.kdop.take(rows, axis=0) - lagged
        ahead, behind = shift[:, :4], -shift[:, 4:]
        together = np.where(ahead * behind > 0, np.minimum(np.abs(ahead), np.abs(behind)), 0.0)
        self.moved_m[rows] = together.max(axis=1, initial=0.0)
        self.observed_s[rows] += dt_s
        known = self.size_m.take(rows, axis=0)
        change = self.box.take(rows, axis=0)[:, 3:6] - known
        person = self.final[rows] & IS_PERSON[self.last_class[rows]]
        growth = np.where(person, PERSON_GROWTH, GROWTH)[:, None]
        self.size_m[rows] = known + np.where(change > 0, growth, SHRINKAGE) * change
        self.lagged_kdop[rows] = lagged + (1.0 - math.exp(-dt_s / LAG_S)) * shift
