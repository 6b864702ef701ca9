"""The table of the tracks alive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.geometry.kdop import DIRECTIONS
from modt.types import (
    Bool,
    Decisions,
    Evidence,
    Float64,
    Int,
    Motion,
    ObjectBoxes,
    Proposals,
    Requests,
    TrackedFrame,
    Tracks,
    column,
)


@dataclass(frozen=True)
class TrackTable(Tracks):
    """Tracks with the columns that only the tracker needs; k-DOPs as in geometry/kdop.py."""

    kdop: Float64 = column(float, 8)  # k-DOP last observed [m, world]
    # `kdop` smoothed with time constant lag_s; `moved_m` is measured from it [m, world]
    lagged_kdop: Float64 = column(float, 8)
    envelope: Float64 = column(float, 8, fill=-np.inf)  # known extent: largest k-DOP about the position, decaying [m]
    mean_kdop: Float64 = column(float, 8)  # mean of the k-DOP about the position; an end that jumps restarts [m]
    # extra position variance along each axis, by ends that disagreed [m2]
    end_variance: Float64 = column(float, 4)
    bottom: Float64 = column(float)  # lowest point last observed [m, world]
    top: Float64 = column(float)  # highest point last observed [m, world]
    kdop_position: Float64 = column(float, 2)  # measured position when `kdop` was observed [m, world]
    centroid: Float64 = column(float, 2)  # centroid of the last proposal [m, world]
    rest_position: Float64 = column(float, 2)  # position at which the track was last known to rest [m, world]
    stationary: Bool = column(bool)  # the track is at rest
    reappears: Bool = column(bool)  # the track has a proposal after a frame without one
    moving_mean: Float64 = column(float, 4)  # x, y [m] and their velocities [m/s] if the track moves, world frame
    moving_covariance: Float64 = column(float, 4, 4)  # its covariance
    resting_mean: Float64 = column(float, 2)  # position if the track rests [m, world]
    resting_covariance: Float64 = column(float, 2, 2)  # its covariance [m2]
    # time since the last proposal, but for that in hiding; a stalled clock adds one period a frame [s]
    unseen_s: Float64 = column(float)

    def predicted_kdops(self, rows: Int | slice = slice(None)) -> Float64:
        """(8, R) k-DOPs last observed of the rows, of all by default, where the filter expects them now."""
        kdop: Float64 = (self.kdop[rows] + (self.x[rows, :2] - self.kdop_position[rows]) @ DIRECTIONS).T.copy()
        return kdop

    def known_kdops(self, rows: Int) -> Float64:
        """(8, R) known extents of the rows in the world, where the filter expects them now."""
        kdop: Float64 = (self.envelope.take(rows, axis=0) + self.x.take(rows, axis=0)[:, :2] @ DIRECTIONS).T.copy()
        return kdop


class LiveTracks:
    """State that survives an exchange of the stages: the track table, the next id and the time of the last frame.

    Attributes:
        table: the tracks as the tracker has them: its own columns can be written to, the others are read-only.
        next_id: identity of the next new track.
        stamp_s: time of the last frame [s], None before the first.
    """

    def __init__(self) -> None:
        self.next_id = 0
        self.stamp_s: float | None = None
        self._hold(TrackTable.blank())
        self._saved = self.table, self.next_id

    def _hold(self, table: TrackTable) -> None:
        """Exchange the table for another one, whose columns can all be written to."""
        self._evidence = Evidence.of(table)
        self._requests = Requests.of(table)
        self._decisions = Decisions.of(table)
        self._boxes = ObjectBoxes.of(table)
        self.table = table.read_only(Evidence, Requests, Decisions, ObjectBoxes)

    def renew(self, kept: Int, n_new: int) -> Int:
        """Keep these rows, in their order, and add blank ones with new identities, whose rows are returned."""
        self._hold(self.table.renewed(kept, n_new))
        self.table.id[len(kept) :] = np.arange(self.next_id, self.next_id + n_new)
        self.next_id += n_new
        return np.arange(len(kept), len(kept) + n_new)

    def tracked(self, proposals: Proposals, wants_class: Bool) -> TrackedFrame:
        """The tracks by owner, for the stages after the tracker."""
        return TrackedFrame(
            motion=Motion.of(self.table).read_only(),
            evidence=Evidence.of(self.table),
            own_evidence=self._evidence,
            requests=self._requests,
            decisions=self._decisions,
            boxes=self._boxes,
            proposals=proposals.lock(),
            wants_class=wants_class,
        )

    def save(self) -> Tracks:
        """Copy the tracks at the end of a frame, for `roll_back`; returns the copy, read-only."""
        saved = self.table.copy()
        self._saved = saved, self.next_id
        return Tracks.of(saved).lock()

    def roll_back(self) -> None:
        """Return to the tracks that were saved last, and to the next identity of then, but not to the time."""
        saved, self.next_id = self._saved
        self._hold(saved.copy())

    def clear(self) -> None:
        """Forget the tracks and the time. Identities go on after those that were saved last."""
        self.next_id = self._saved[1]
        self.stamp_s = None
        self._hold(TrackTable.blank())
