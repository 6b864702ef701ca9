"""The tracker's own table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.geometry.kdop import WAYS
from modt.types import Bool, Float64, Int, Tracks


@dataclass(slots=True)
class Followed(Tracks):
    """Tracks with what only the tracker needs to know of them.

    Columns:
        kind: class when the frame began.
        outline: (M, 8) last seen, see outlines.py [m, world].
        hull: (M, 8) outline of all that was seen of it, slowly forgotten, about its place [m].
        shape: (M, 8) mean outline about its place, an end that jumped beginning anew [m].
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

    kind: Int
    outline: Float64
    hull: Float64
    shape: Float64
    doubt: Float64
    foot: Float64
    top: Float64
    shown: Float64
    home: Float64
    still: Bool
    stood: Int
    landmark: Float64
    takes: Int
    inherited: Bool

    @classmethod
    def blank(cls, m: int = 0) -> Self:
        """M rows: nothing seen yet."""
        shared = dict(Tracks.blank(m).columns())
        return cls(
            **shared,
            kind=np.zeros(m, np.int64),
            outline=np.zeros((m, 8)),
            hull=np.full((m, 8), -np.inf),
            shape=np.zeros((m, 8)),
            doubt=np.zeros((m, 4)),
            foot=np.zeros(m),
            top=np.zeros(m),
            shown=np.zeros((m, 2)),
            home=np.zeros((m, 2)),
            still=np.zeros(m, np.bool_),
            stood=np.zeros(m, np.int64),
            landmark=np.zeros((m, 8)),
            takes=np.zeros(m, np.int64),
            inherited=np.zeros(m, np.bool_),
        )

    def move(self, step: Float64) -> None:
        """Put what is somewhere elsewhere, by (M, 2) [m, world]."""
        for column in (self.x, self.box, self.shown, self.home):
            column[:, :2] += step
        self.outline += step @ WAYS
        self.landmark += step @ WAYS
