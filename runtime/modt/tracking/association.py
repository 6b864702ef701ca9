"""Association: which proposal belongs to which track."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from modt.observations import Observations
from modt.tracking.track_table import TrackTable
from modt.types import NONE, Float64, Int, Proposals

NO_ROWS = np.zeros(0, np.int64)
UNMEASURED_M2 = 100.0
"""Variance along either axis of a position that was not measured."""


class Matches(NamedTuple):
    """Pairs of a track and a proposal; no row and no proposal occurs twice.

    Attributes:
        rows: (K,) rows of the tracks.
        proposals: (K,) proposals of this frame.
        position: (K, 2) position of each track as its proposal measures it [m, world].
        covariance: (K, 2, 2) covariance of that position [m2].
        end_variance: (K, 4) part of that variance along each axis, left by ends of the k-DOP that disagree [m2].
    """

    rows: Int
    proposals: Int
    position: Float64
    covariance: Float64
    end_variance: Float64

    def reassigned(self, tracks: TrackTable, rows: Int, proposals: Int) -> Matches:
        """Matches after the tracks `rows` (R,) exchanged their proposals; NONE removes one.

        An exchanged proposal measures no position, since its k-DOP is not that of the track.
        """
        changed = np.zeros(len(tracks), np.bool_)
        changed[rows] = True
        same = (~changed[self.rows]).nonzero()[0]
        matched = (proposals != NONE).nonzero()[0]
        rows = rows[matched]
        new = Matches(
            rows=rows,
            proposals=proposals[matched],
            position=tracks.x.take(rows, axis=0)[:, :2],
            covariance=(UNMEASURED_M2 * np.eye(2))[None].repeat(len(rows), axis=0),
            end_variance=tracks.end_variance.take(rows, axis=0),
        )
        return Matches(*(np.concatenate([a.take(same, axis=0), b]) for a, b in zip(self, new, strict=True)))


class Associated(NamedTuple):
    """A frame after association."""

    proposals: Proposals
    observations: Observations  # the proposals in the world
    matches: Matches
    joined: Int = NO_ROWS  # tracks whose proposal was joined from parts; a track may occur twice


class Association(Protocol):
    """Finds the proposals of the tracks."""

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs of predicted tracks and the observations of a frame."""
        ...

    def initial_position(self, observations: Observations) -> Float64:
        """(P, 2) position of a track that begins with each observation [m, world]."""
        ...
