"""The tracker's own table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.geometry.kdop import DIRECTIONS
from modt.types import Bool, Float64, Int, Tracks


@dataclass(slots=True)
class TrackTable(Tracks):
    """Tracks with the columns that only the tracker needs.

    Columns:
        last_class: class when the frame began.
        kdop: (M, 8) last observed, see geometry/kdop.py [m, world].
        envelope: (M, 8) k-DOP of all that was observed, slowly decaying, about the position [m].
        mean_kdop: (M, 8) mean k-DOP about the position; an end that jumped begins anew [m].
        end_variance: (M, 4) variance of the position along each axis by ends of the k-DOP that disagreed [m2].
        bottom, top: lowest and highest point last observed [m, world].
        anchor: (M, 2) position that the last k-DOP was assigned [m, world].
        rest_position: (M, 2) position at which the track was last known to rest [m, world].
        stationary: the track is at rest.
    """

    last_class: Int
    kdop: Float64
    envelope: Float64
    mean_kdop: Float64
    end_variance: Float64
    bottom: Float64
    top: Float64
    anchor: Float64
    rest_position: Float64
    stationary: Bool

    @classmethod
    def blank(cls, m: int = 0) -> Self:
        """M rows: nothing observed yet."""
        shared = dict(Tracks.blank(m).columns())
        return cls(
            **shared,
            last_class=np.zeros(m, np.int64),
            kdop=np.zeros((m, 8)),
            envelope=np.full((m, 8), -np.inf),
            mean_kdop=np.zeros((m, 8)),
            end_variance=np.zeros((m, 4)),
            bottom=np.zeros(m),
            top=np.zeros(m),
            anchor=np.zeros((m, 2)),
            rest_position=np.zeros((m, 2)),
            stationary=np.zeros(m, np.bool_),
        )

    def predicted_kdops(self, rows: Int | slice = slice(None)) -> Float64:
        """(8, R) k-DOPs last observed of the rows, of all by default, where the filter expects them now."""
        kdop: Float64 = (self.kdop[rows] + (self.x[rows, :2] - self.anchor[rows]) @ DIRECTIONS).T.copy()
        return kdop

    def known_kdops(self, rows: Int) -> Float64:
        """(8, R) k-DOPs of all that was observed of the rows, where the filter expects them now."""
        kdop: Float64 = (self.envelope.take(rows, axis=0) + self.x.take(rows, axis=0)[:, :2] @ DIRECTIONS).T.copy()
        return kdop
