"""Which proposal belongs to which track."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.optimize import linear_sum_assignment

from modt.config import TrackingConfig
from modt.geometry.overlap import iou_3d
from modt.observations import Observations
from modt.tracking.track_table import TrackTable
from modt.types import NONE, Float64, Int

FORBIDDEN = 1e6
"""Cost of a pair that may not be."""
UNMEASURED_M2 = 100.0 * np.eye(2)
"""Covariance of a place that an outline says nothing about."""


@dataclass(frozen=True, slots=True)
class Matches:
    """Pairs of a track and a proposal; no row and no proposal occurs twice.

    Attributes:
        rows: (K,) of the tracks.
        proposals: (K,) of this frame.
        place: (K, 2) where each proposal puts its track [m, world].
        covariance: (K, 2, 2) of that place [m2].
        doubt: (K, 4) what there is in it of ends of the outline that disagree, along each axis [m2].
    """

    rows: Int
    proposals: Int
    position: Float64
    covariance: Float64
    end_variance: Float64

    def instead(self, tracks: TrackTable, rows: Int, proposals: Int) -> Matches:
        """The matches with these proposals, NONE for nothing, for those that tracks (R,) had.

        What changed hands measures nothing: its outline is not that of the track.
        """
        changed = np.zeros(len(tracks), np.bool_)
        changed[rows] = True
        kept = (~changed[self.rows]).nonzero()[0]
        some = proposals != NONE
        rows, proposals = rows[some], proposals[some]
        unmeasured = UNMEASURED_M2[None].repeat(len(rows), axis=0)
        return Matches(
            np.concatenate([self.rows[kept], rows]),
            np.concatenate([self.proposals[kept], proposals]),
            np.concatenate([self.position.take(kept, axis=0), tracks.x.take(rows, axis=0)[:, :2]]),
            np.concatenate([self.covariance.take(kept, axis=0), unmeasured]),
            np.concatenate([self.end_variance.take(kept, axis=0), tracks.end_variance.take(rows, axis=0)]),
        )


class Association(Protocol):
    """Finds the proposals of the tracks."""

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs of predicted tracks and this frame's sightings."""
        ...

    def initial_position(self, observations: Observations) -> Float64:
        """(P, 2) where a track begins that a sighting is the first of [m, world]."""
        ...


def assign(rows: Int, columns: Int, cost: Float64, limit: float) -> Int:
    """Indices of the candidate pairs that a least-cost assignment keeps.

    A pair is kept for certain if to part it cannot pay: if the next best of its row and the next best of its column
    together cost more than the pair and limit, which is the most that their partners then lose. The Hungarian
    algorithm decides the rest, on the rows and columns that it concerns.

    Args:
        rows: (K,) first index of each candidate pair.
        columns: (K,) second index; no pair occurs twice.
        cost: (K,) of each, below limit.
        limit: cost of leaving a row or a column without a partner.
    """
    if len(rows) < 2:
        return np.arange(len(rows))
    order = (-cost).argsort()
    rows, columns, cost = rows[order], columns[order], cost[order]
    of_row, other_row = _two_best(rows, cost, limit)
    of_column, other_column = _two_best(columns, cost, limit)
    kept = cost + limit < other_row + other_column
    contested = (~(kept[of_row] | kept[of_column])).nonzero()[0]
    if len(contested):
        i, n = _compact(rows[contested])
        j, k = _compact(columns[contested])
        matrix, chosen = np.full((n, k), limit), np.zeros((n, k), np.bool_)
        matrix[i, j] = cost[contested]
        chosen[linear_sum_assignment(matrix)] = True
        kept[contested] = chosen[i, j]
    pairs: Int = order[kept]
    pairs.sort()
    return pairs


def _two_best(index: Int, cost: Float64, limit: float) -> tuple[Int, Float64]:
    """(K,) the best pair of the same index, (K,) cost of the next best, limit where there is none; dearest first."""
    k = np.arange(len(index))
    best = np.empty(index.max() + 1, np.int64)
    best[index] = k  # the last one written is the cheapest
    of_index = best[index]
    others = (of_index != k).nonzero()[0]
    next_best = np.full(len(best), limit)
    next_best[index[others]] = cost[others]
    return of_index, next_best[index]


def assign_all(cost: Float64, limit: float) -> tuple[Int, Int]:
    """Rows and columns of a least-cost assignment of few to few; cost (n, k), pairs of limit and more may not be."""
    rows, columns = linear_sum_assignment(np.minimum(cost, limit))
    chosen = cost[rows, columns] < limit
    return rows[chosen], columns[chosen]


def _compact(index: Int) -> tuple[Int, int]:
    """Indices renumbered without gaps, and how many there are."""
    number = (np.bincount(index) > 0).cumsum()
    return number[index] - 1, int(number[-1])


class PaperAssociation:
    """The paper's cost (section III-B), gated by T_DA; a proposal lies where its points lie on average.

    The paper writes the cost as alpha (1 - I) - beta N - gamma S with N and S *differences* of point number and
    size: taken literally, a worse match would cost less. Both are read as penalties here. I is the intersection
    over union of the boxes' volumes, S the sum of the differences of length, width and height [m].
    """

    def __init__(self, config: TrackingConfig) -> None:
        self.config = config

    def match(self, tracks: TrackTable, observations: Observations) -> Matches:
        """Pairs whose cost is at most T_DA."""
        rows, columns = self._near(tracks, observations)
        cost = self.cost(tracks, observations, rows, columns)
        low = cost <= self.config.t_da
        rows, columns, cost = rows[low], columns[low], cost[low]
        keep = assign(rows, columns, cost, FORBIDDEN)
        covariance = np.square(self.config.position_sigma_m) * np.eye(2)[None].repeat(len(keep), axis=0)
        rows, columns = rows[keep], columns[keep]
        return Matches(rows, columns, observations.centroid[columns], covariance, np.zeros((len(keep), 4)))

    def cost(self, tracks: TrackTable, observations: Observations, rows: Int, columns: Int) -> Float64:
        """(K,) cost of the pairs."""
        a, b = tracks.box[rows].copy(), observations.box[columns]
        a[:, :2] += tracks.x[rows, :2] - tracks.anchor[rows]  # the last box, carried along the prediction
        points = np.abs(tracks.points[rows] - observations.count[columns])
        size = np.abs(a[:, 3:6] - b[:, 3:6]).sum(axis=1)
        penalty: Float64 = (
            self.config.alpha * (1 - iou_3d(a, b)) + self.config.beta * points + self.config.gamma * size
        )
        return penalty

    def initial_position(self, observations: Observations) -> Float64:
        """Mean of the points."""
        return observations.centroid

    def _near(self, tracks: TrackTable, observations: Observations) -> tuple[Int, Int]:
        """Pairs whose boxes could touch: without overlap no pair can pass, unless alpha is below T_DA."""
        centre = tracks.box[:, :2] + tracks.x[:, :2] - tracks.anchor
        offset = centre[:, None] - observations.box[None, :, :2]
        if self.config.alpha <= self.config.t_da:
            near = np.ones(offset.shape[:2], np.bool_)
        else:
            reach = np.hypot(tracks.box[:, 3], tracks.box[:, 4])[:, None]
            reach = (reach + np.hypot(observations.box[:, 3], observations.box[:, 4])) / 2
            near = (offset**2).sum(axis=2) < reach**2
        rows, columns = np.nonzero(near)
        return rows, columns
