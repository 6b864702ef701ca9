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
from modt.types import Float32, Float64, Int, Motion, Tracks

_OF_BOTH = ("hits", "observed_s")
"""Columns that add up as a track continues another one."""
_COLUMNS = {f.name for f in fields(TrackTable)} - {f.name for f in fields(Tracks)} | {f.name for f in fields(Motion)}
_OF_THE_NEW = sorted(_COLUMNS - {"id", "state", "final", "age", *_OF_BOTH})
"""Columns that a track takes over from the one that it continues: where it is, and how it moves."""


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
        people = IS_WALKER[tracks.object_class[matches.rows]].nonzero()[0]
        if nearest is None or not len(people):
            return matches.covariance
        sides = self._sight.bounded_sides(nearest, frame.proposals, matches.proposals[people])
        covariance = matches.covariance.copy()
        covariance[people[sides.any(axis=1)]] += self._tuning.side_sigma_m**2 * np.eye(2)
        return covariance

    def stop_clock(self, tracks: TrackTable, nearest: Float32, T_world_sensor: Float64, dt_s: float) -> None:
        """Do not count a time step without a proposal of people in hiding, unless their position is too uncertain.

        Where the clock stalls, tracks age by a period in spite of hiding, since only `dt_s` is taken off.

        Nobody steps out unseen: who is expected in view, one step out of hiding, stays where that step began.

        Args:
            tracks: after the update of the frame.
            nearest: result of `Sight.look` for the frame.
            T_world_sensor: (4, 4) pose of the sensor.
            dt_s: time step [s].
        """
        variance = np.maximum(tracks.P[:, 0, 0], tracks.P[:, 1, 1])
        known = variance < self._tuning.max_sigma_m**2
        rows = (~tracks.observed & IS_PERSON[tracks.object_class] & known).nonzero()[0]
        if not len(rows):
            return
        step = dt_s * tracks.velocity[rows]
        moved = tracks.x[rows, :2] - tracks.kdop_position[rows]
        box = tracks.box[np.tile(rows, 2)]
        box[:, :2] += np.concatenate([moved, moved - step])
        hidden = self._sight.hides(nearest, transform_boxes(inverse(T_world_sensor), box))
        is_hidden, was_hidden = hidden.reshape(2, -1)
        stays = was_hidden & ~is_hidden
        tracks.x[rows[stays], :2] -= step[stays]
        tracks.moving_mean[rows[stays], :2] -= dt_s * tracks.moving_mean[rows[stays], 2:]
        tracks.unseen_s[rows[is_hidden | was_hidden]] -= dt_s

    def reunite(self, tracks: TrackTable) -> Int:
        """Continue tracks of people without a proposal by new tracks of people that began where they may come out.

        The track expected nearest comes first.

        Returns:
            Rows (R,) of the new tracks that were continued; they are to be deleted.
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
        continued = np.zeros(len(new), np.bool_)
        while np.isfinite(distance_m.min()):
            i, k = np.unravel_index(distance_m.argmin(), distance_m.shape)
            _continue(tracks, int(lost[k]), int(new[i]))
            continued[i] = True
            distance_m[i] = distance_m[:, k] = np.inf
        rows: Int = new[continued]
        return rows


def _continue(tracks: TrackTable, lost: int, new: int) -> None:
    """Let a lost track go on as a new one."""
    for name in _OF_THE_NEW:
        column = getattr(tracks, name)
        column[lost] = column[new]
    for name in _OF_BOTH:
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
