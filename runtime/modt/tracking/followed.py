"""The tracker's own table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.types import Bool, Float64, Int, Tracks


@dataclass(slots=True)
class Followed(Tracks):
    """Tracks with what only the tracker needs to know of them.

    Columns:
        low, high: (M, 4) outline last seen, along sightings.AXES [m, world].
        hull_low, hull_high: (M, 4) outline of all that was seen of it, slowly forgotten, about its place [m].
        foot, top: lowest and highest point last seen [m, world].
        shown: (M, 2) place that the outline was taken to show [m, world].
        home: (M, 2) place at which the track was last known to stand [m, world].
        still: the track stands.
        stood: frames with a proposal since it began to.
        stood_low, stood_high: (M, 4) mean outline since then, an end that jumped beginning anew [m, world].
        inherited: its class was taken over from a remembered place, not from a classification of its own.
    """

    low: Float64
    high: Float64
    hull_low: Float64
    hull_high: Float64
    foot: Float64
    top: Float64
    shown: Float64
    home: Float64
    still: Bool
    stood: Int
    stood_low: Float64
    stood_high: Float64
    inherited: Bool

    @classmethod
    def blank(cls, m: int = 0) -> Self:
        """M rows: nothing seen yet."""
        shared = dict(Tracks.blank(m).columns())
        return cls(
            **shared,
            low=np.zeros((m, 4)),
            high=np.zeros((m, 4)),
            hull_low=np.zeros((m, 4)),
            hull_high=np.zeros((m, 4)),
            foot=np.zeros(m),
            top=np.zeros(m),
            shown=np.zeros((m, 2)),
            home=np.zeros((m, 2)),
            still=np.zeros(m, np.bool_),
            stood=np.zeros(m, np.int64),
            stood_low=np.zeros((m, 4)),
            stood_high=np.zeros((m, 4)),
            inherited=np.zeros(m, np.bool_),
        )
