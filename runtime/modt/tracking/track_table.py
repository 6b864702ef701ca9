"""The tracker's own table."""

from __future__ import annotations

import ctypes
import math
from array import array
from dataclasses import dataclass

import numpy as np

from modt.class_sizes import IS_PERSON, MAX_SIZE_M
from modt.classes import ObjectClass
from modt.geometry.kdop import DIRECTIONS
from modt.geometry.tuning import ShapeTuning
from modt.native.library import FLOAT64, INT64, Own, declare, structure
from modt.observations import Observations
from modt.types import (
    Bool,
    Decisions,
    Evidence,
    Float64,
    Int,
    Motion,
    Proposals,
    Requests,
    TrackedFrame,
    Tracks,
    column,
)

ESTABLISHED_HITS = 4
"""Frames in which a track was observed, from which its velocity and class change proposals."""
LAG_S = 1.5
"""Time constant of the place that a displacement is measured from."""
AGREE_M = ShapeTuning().agreement_m
ENVELOPE_DECAY, MEAN_KDOP_DECAY = 0.98, 0.8
"""Share kept a frame of an extent that is not seen again; greatest weight of the past in a mean k-DOP."""
GROWTH, PERSON_GROWTH, SHRINKAGE = 0.5, 0.1, 0.02
"""Weights in the size of a track: of a larger box; of a larger box of a confirmed person, who is merged with things
in passing; and of a smaller box, since the part that is hidden was seen before."""
CONFIRMED_GROWTH: Float64 = np.where(IS_PERSON, PERSON_GROWTH, GROWTH)
"""(4,) weight of a larger box of a track whose class is confirmed."""
MAX_LENGTH_M: Float64 = np.where(np.arange(len(MAX_SIZE_M)) == ObjectClass.BACKGROUND, np.inf, MAX_SIZE_M[:, 0])
"""(4,) length of a track of each class beyond which it is merged with others."""


@dataclass(frozen=True)
class TrackTable(Tracks):
    """Tracks with the columns that only the tracker needs; k-DOPs as in geometry/kdop.py."""

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


class LiveTracks:
    """The tracks alive, and what else goes on from frame to frame. The stages may be exchanged around it.

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
        self.table = table.read_only(Evidence, Requests, Decisions)

    def renew(self, kept: Int, n_new: int) -> Int:
        """Keep these rows, in their order, and add blank ones with new identities, whose rows are returned."""
        self._hold(self.table.renewed(kept, n_new))
        new = np.arange(len(kept), len(kept) + n_new)
        self.table.id[new] = np.arange(self.next_id, self.next_id + n_new)
        self.next_id += n_new
        return new

    def tracked(self, proposals: Proposals, wants_class: Bool) -> TrackedFrame:
        """The tracks by owner, for the stages after the tracker."""
        return TrackedFrame(
            motion=Motion.of(self.table).read_only(),
            evidence=Evidence.of(self.table),
            own_evidence=self._evidence,
            requests=self._requests,
            decisions=self._decisions,
            proposals=proposals.lock(),
            wants_class=wants_class,
        )

    def save(self) -> Tracks:
        """Copy the tracks at the end of a frame, for `roll_back`; the copy is read-only."""
        saved = self.table.copy()
        self._saved = saved, self.next_id
        return Tracks.of(saved).lock()

    def roll_back(self) -> None:
        """Return to the tracks that were saved last."""
        saved, self.next_id = self._saved
        self._hold(saved.copy())

    def clear(self) -> None:
        """Forget the tracks and the time. Identities go on after those that were saved last."""
        self.next_id = self._saved[1]
        self.stamp_s = None
        self._hold(TrackTable.blank())


def observe(
    t: TrackTable, rows: Int, proposals: Int, observations: Observations, position: Float64, dt_s: float
) -> None:
    """Write what the proposals (R,) show of the rows (R,), at positions (R, 2), dt_s after the frame before.

    The known extent decays slowly towards what is seen, but for an object longer than its class, which is merged with
    others. In the mean k-DOP an end that jumped begins anew.

    The place that a track comes from follows its k-DOP with a lag: at a constant speed v the displacement tends
    to v * LAG_S. Along each axis it is that of the end that moved less, and nothing where the ends moved apart:
    a changing view moves one of them alone.
    """
    kdop, box = observations.kdop.T.take(proposals, axis=0), observations.box.take(proposals, axis=0)
    about, class_ = kdop - position @ DIRECTIONS, t.object_class[rows]
    known, mean = t.envelope.take(rows, axis=0), t.mean_kdop.take(rows, axis=0)
    lagged, size = t.lagged_kdop.take(rows, axis=0), t.size_m.take(rows, axis=0)
    merged = (about[:, :4] + about[:, 4:] > MAX_LENGTH_M[class_][:, None]).any(axis=1)
    envelope = np.maximum(about, ENVELOPE_DECAY * known + (1 - ENVELOPE_DECAY) * about)
    off, shift, change = mean - about, kdop - lagged, box[:, 3:6] - size
    weight = np.minimum(1.0 - 1.0 / t.hits[rows], MEAN_KDOP_DECAY)[:, None]
    ahead, behind = shift[:, :4], -shift[:, 4:]
    together = np.maximum(np.minimum(ahead, behind), -np.maximum(ahead, behind))
    growth = np.where(t.final[rows], CONFIRMED_GROWTH[class_], GROWTH)[:, None]
    t.envelope[rows] = np.where(merged[:, None], known, envelope)
    t.mean_kdop[rows] = about + (np.abs(off) < AGREE_M) * weight * off
    t.moved_m[rows] = together.max(axis=1, initial=0.0)
    t.observed_s[rows] += dt_s
    t.size_m[rows] = size + np.where(change > 0, growth, SHRINKAGE) * change
    t.lagged_kdop[rows] = lagged + (1.0 - math.exp(-dt_s / LAG_S)) * shift
    t.anchor[rows], t.kdop[rows], t.box[rows], t.proposal[rows] = position, kdop, box, proposals
    t.points[rows] = observations.count[proposals]
    t.bottom[rows], t.top[rows] = observations.bottom[proposals], observations.top[proposals]


class NativeObserve:
    """The same in C (`modt.native`)."""

    def __init__(self, library: ctypes.CDLL) -> None:
        declare(library, {"modt_observe": (None, (Own, Own, INT64, INT64, ctypes.c_int64, FLOAT64, FLOAT64, Own))})
        self._library, self._limits = library, (*MAX_LENGTH_M.tolist(), *CONFIRMED_GROWTH.tolist())

    def __call__(
        self, t: TrackTable, rows: Int, proposals: Int, observations: Observations, position: Float64, dt_s: float
    ) -> None:
        """Write what the proposals (R,) show of the rows (R,)."""
        o = observations
        floats = t.kdop, t.lagged_kdop, t.envelope, t.mean_kdop, t.box, t.size_m, t.anchor, t.moved_m, t.observed_s
        columns = structure(*floats, t.bottom, t.top, t.proposal, t.points, t.hits, t.object_class, t.final)
        seen = structure(o.kdop, o.box, o.bottom, o.top, o.count, len(o))
        decays = (ENVELOPE_DECAY, MEAN_KDOP_DECAY, AGREE_M, SHRINKAGE, GROWTH, 1.0 - math.exp(-dt_s / LAG_S), dt_s)
        numbers = array("d", (*decays, *self._limits))
        along = position @ DIRECTIONS
        self._library.modt_observe(columns, seen, rows, proposals, len(rows), position, along, numbers)
