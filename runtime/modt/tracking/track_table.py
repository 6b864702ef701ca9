"""The tracker's own table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.geometry.kdop import DIRECTIONS
from modt.types import Bool, Float64, Int, Tracks


@dataclass(slots=True)
class TrackTable(Tracks):
    """Tracks with what only the tracker needs to know of them.

    Columns:
        kind: class when the frame began.
        outline: (M, 8) last seen, see outlines.py [m, world].
        hull: (M, 8) outline of all that was seen of it, slowly forgotten, about its place [m].
        mean_kdop: (M, 8) mean outline about its place, an end that jumped beginning anew [m].
        doubt: (M, 4) variance along each axis of where the outline puts it, by what its ends disagreed [m2].
        foot, top: lowest and highest point last seen [m, world].
        shown: (M, 2) place that the outline was taken to show [m, world].
        home: (M, 2) place at which the track was last known to stand [m, world].
        still: the track stands.
        stood: frames in a row without a pose in which it stood and was seen; 0 where poses are given (landmarks.py).
        landmark: (M, 8) mean outline in these, an end that jumped beginning anew [m, world].
        takes: times that its proposal was taken out of another since it last had one of its own.
        inherited: its class was taken over from a remembered place, and it was not classified itself since.
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
    stationary_frames: Int
    landmark_kdop: Float64
    splits: Int
    inherited: Bool

    @classmethod
    def blank(cls, m: int = 0) -> Self:
        """M rows: nothing seen yet."""
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
            stationary_frames=np.zeros(m, np.int64),
            landmark_kdop=np.zeros((m, 8)),
            splits=np.zeros(m, np.int64),
            inherited=np.zeros(m, np.bool_),
        )

    def move(self, step: Float64) -> None:
        """Put what is somewhere elsewhere, by (M, 2) [m, world]."""
        for column in (self.x, self.box, self.anchor, self.rest_position):
            column[:, :2] += step
        self.kdop += step @ DIRECTIONS
        self.landmark_kdop += step @ DIRECTIONS
