"""Hiding: a person whom something nearer hides keeps the track, and comes out of hiding with it.

Three things belong to it. Where a side of a person is hidden, the visible part shrinks towards its other side, and
its position says little, so the velocity on going into hiding is kept. While something hides the place where a person
is expected, the time without a proposal does not count, until the position is uncertain by a person's size. And
whoever comes out somewhere between where a person was last seen and where that person is expected, is that person:
people stop behind a pillar, or turn back.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from modt.class_sizes import IS_PERSON, IS_WALKER
from modt.geometry import inverse, transform_boxes
from modt.tracking.association import NO_ROWS, Associated
from modt.tracking.sight import Sight
from modt.tracking.track_table import TrackTable
from modt.tracking.tuning import HidingTuning
from modt.types import Bool, Float32, Float64, Int, Motion, Tracks

_COLUMNS = {f.name for f in fields(TrackTable)} - {f.name for f in fields(Tracks)} | {f.name for f in fields(Motion)}
"""Columns of the tracker. Those of the other stages, such as the evidence of the class, stay with the lost track."""
_ADDED = ("hits", "observed_s")
"""Columns of the new track that are added to those of the lost one."""
_REPLACED = sorted(_COLUMNS - {"id", "state", "final", "age", *_ADDED})
"""Columns of the lost track that those of the new one replace: where it is, and how it moves."""


class Hiding:
    """Keeps tracks of people in hiding.

    Args:
        sight: lines of sight.
        tuning: limits.
    """

    def __init__(self, sight: Sight, tuning: HidingTuning = HidingTuning()) -> None:
        self._sight = sight
        self._tuning = tuning

    def loosened(self, tracks: TrackTable, frame: Associated, nearest: Float32 | None) -> Float64:
        """(K, 2, 2) covariances of the matched positions, greater of pedestrians with a bounded side.

        Args:
            tracks: as predicted.
            frame: proposals and matches.
            nearest: result of `Sight.look` for the frame; None if its points are not known.
        """
        matches = frame.matches
        walkers = IS_WALKER[tracks.object_class[matches.rows]].nonzero()[0]
        if nearest is None or not len(walkers):
            return matches.covariance
        sides = self._sight.bounded_sides(nearest, frame.proposals, matches.proposals[walkers])
        covariance = matches.covariance.copy()
        covariance[walkers[sides.any(axis=1)]] += self._tuning.side_sigma_m**2 * np.eye(2)
        return covariance

    def keep_hidden(self, tracks: TrackTable, nearest: Float32, T_world_sensor: Float64, dt_s: float) -> None:
        """Do not count a time step without a proposal of people in hiding, unless their position is too uncertain.

        Nobody steps out unseen: who is expected in view, one step out of hiding, stays where that step began.

        While the clock stalls, tracks age by a period a frame in spite of hiding, since only `dt_s` is taken off.

        Args:
            tracks: after the update of the frame.
            nearest: result of `Sight.look` for the frame.
            T_world_sensor: (4, 4) pose of the sensor.
            dt_s: time step [s].
        """
        variance = np.maximum(tracks.P[:, 0, 0], tracks.P[:, 1, 1])
        certain = variance < self._tuning.max_sigma_m**2
        rows = (~tracks.observed & IS_PERSON[tracks.object_class] & certain).nonzero()[0]
        if not len(rows):
            return
        hidden_now, hidden_before = self._hidden_now_and_before(tracks, rows, nearest, T_world_sensor, dt_s)
        _step_back(tracks, rows[hidden_before & ~hidden_now], dt_s)
        tracks.unseen_s[rows[hidden_now | hidden_before]] -= dt_s

    def _hidden_now_and_before(
        self, tracks: TrackTable, rows: Int, nearest: Float32, T_world_sensor: Float64, dt_s: float
    ) -> Bool:
        """(2, R) whether rows (R,) are hidden where they are expected, and where they were before the time step."""
        moved = tracks.x[rows, :2] - tracks.kdop_position[rows]
        box = tracks.box[np.tile(rows, 2)]  # as last seen, which is at kdop_position
        box[:, :2] += np.concatenate([moved, moved - dt_s * tracks.velocity[rows]])
        hidden = self._sight.hides(nearest, transform_boxes(inverse(T_world_sensor), box))
        return hidden.reshape(2, -1)

    def merge_returned(self, tracks: TrackTable) -> Int:
        """Merge new tracks of people into lost ones that may have come out of hiding there, the nearest pair first.

        Returns:
            Rows (R,) of the new tracks that were merged; they are to be deleted.
        """
        tuning = self._tuning
        people = IS_PERSON[tracks.object_class]
        lost = (people & (tracks.missed > 0)).nonzero()[0]
        new = (people & (tracks.missed == 0) & (tracks.age <= tuning.max_age)).nonzero()[0]
        if not len(lost) or not len(new):
            return NO_ROWS
        position = tracks.x[new, None, :2]
        expected = tracks.x[lost, :2]
        fits = tracks.age[new, None] <= tracks.missed[lost]  # both were not there at once
        fits &= _distance_m(position, tracks.kdop_position[lost], expected) < tuning.reach_m
        distance_m = np.where(fits, _distance_m(position, expected, expected), np.inf)
        is_merged = np.zeros(len(new), np.bool_)
        while np.isfinite(distance_m.min()):
            i, k = np.unravel_index(distance_m.argmin(), distance_m.shape)
            _merge(tracks, int(lost[k]), int(new[i]))
            is_merged[i] = True
            distance_m[i] = distance_m[:, k] = np.inf
        rows: Int = new[is_merged]
        return rows


def _step_back(tracks: TrackTable, rows: Int, dt_s: float) -> None:
    """Move tracks (R,) back to where they were before a time step."""
    tracks.x[rows, :2] -= dt_s * tracks.velocity[rows]
    tracks.moving_mean[rows, :2] -= dt_s * tracks.moving_mean[rows, 2:]


def _merge(tracks: TrackTable, lost: int, new: int) -> None:
    """Give a lost track the place and the motion of the new one. Its id, age, state and class stay."""
    for name in _REPLACED:  # any column that the tracker writes
        column = getattr(tracks, name)
        column[lost] = column[new]
    for name in _ADDED:
        column = getattr(tracks, name)
        column[lost] += column[new]


def _distance_m(position: Float64, start: Float64, end: Float64) -> Float64:
    """(K, L) distances of positions (K, 1, 2) from the straight ways from start to end (L, 2) [m]."""
    way = end - start
    length2 = np.maximum((way * way).sum(axis=1), 1e-9)
    share = np.clip(((position - start) * way).sum(axis=2) / length2, 0.0, 1.0)
    off = position - start - share[..., None] * way
    distance_m: Float64 = np.hypot(off[..., 0], off[..., 1])
    return distance_m
