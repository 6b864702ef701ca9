"""The tracking stage: predict, associate, update, births and deaths (sections III-B, IV-B and V-B)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.class_sizes import IS_PERSON
from modt.classes import PERSON_M, ObjectClass
from modt.config import TrackingConfig
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Located, Observations, StaticTracks
from modt.tracking.association import Associated, Association, Matches
from modt.tracking.background_map import CAPACITY, BackgroundMap
from modt.tracking.kalman import SPEED, filter_of
from modt.tracking.kdop_association import KdopAssociation
from modt.tracking.regrouping import Regrouping
from modt.tracking.states import Event, StateMachine
from modt.tracking.track_table import LiveTracks, NativeObserve, TrackTable, observe
from modt.types import NONE, Bool, Cut, Float64, Int, Proposals, TrackedFrame, Tracks

ACCELERATION_SIGMA_MPS2, TURN_SIGMA_RADPS = 2.0, 0.3
"""Process noise of speed [m/s2] and heading [rad/s]."""
INITIAL_POSITION_SIGMA_M, INITIAL_SPEED_SIGMA_MPS = 0.3, 8.0
"""Deviations of a new track."""
STATIONARY_RADIUS_M, STATIONARY_SIGMA_MPS = 0.5, 1.0
"""A track this near to its rest position is stationary: the speed 0 is observed of it, with this deviation."""
STOPPED_MPS, REST_GAIN = 0.5, 0.1
"""A moving track slower than this has a new rest position; weight of a new position in the rest position."""
MIN_STEP_SHARE = 0.1
"""A time step shorter than this share of the period means a stalled clock."""


def association_of(config: TrackingConfig, kernels: GeometryKernels = NUMPY_GEOMETRY) -> Association:
    """The association that a configuration names."""
    if config.association == "paper":
        from modt.tracking.paper_association import PaperAssociation

        return PaperAssociation()
    return KdopAssociation(kernels)


class Tracker:
    """Follows every proposal from frame to frame.

    Args:
        config: its parameters.
        machine: the table that drives the states.
        association: association of proposals with tracks; by default the configured one.
        period_s: time between sweeps; a track that is not seen is kept for `max_missed` of them.
        kernels: passes over points and pairs.
        live: tracks to go on with; by default none.
    """

    def __init__(
        self,
        config: TrackingConfig,
        machine: StateMachine,
        association: Association | None = None,
        period_s: float = 0.1,
        kernels: GeometryKernels = NUMPY_GEOMETRY,
        live: LiveTracks | None = None,
    ) -> None:
        self.config, self.machine = config, machine
        self.association = association_of(config, kernels) if association is None else association
        self._extended = config.extensions == "all"
        self.background_map = BackgroundMap(kernels, CAPACITY if self._extended else 0)
        self._period_s = period_s
        self._regrouping = Regrouping(kernels)
        self._observe = observe if kernels.library is None else NativeObserve(kernels.library)
        self._filter = filter_of(kernels, ACCELERATION_SIGMA_MPS2, TURN_SIGMA_RADPS)
        position_m, speed_mps = INITIAL_POSITION_SIGMA_M, INITIAL_SPEED_SIGMA_MPS
        self._P_new = np.diag(np.square([position_m, position_m, np.pi, speed_mps]))  # a heading of pi: unknown
        self._live = LiveTracks() if live is None else live

    @property
    def tracks(self) -> TrackTable:
        """The live table: its own columns can be written to, those of other stages are read-only."""
        return self._live.table

    @property
    def state_names(self) -> tuple[str, ...]:
        """Name of each value of tracks.state."""
        return self.machine.names

    def static_tracks(self, stamp_s: float) -> StaticTracks:
        """Facts that the odometry needs of the tracks that a frame at this time may continue."""
        self._forget(stamp_s)
        t = self.tracks
        return StaticTracks(
            id=t.id,
            observed=t.observed,
            stationary=t.stationary,
            candidate=(t.stationary | (t.hits < 3)) & (t.missed <= 2),
            kdop=t.kdop,
            predicted_kdop=t.predicted_kdops(),
        )

    def track(self, stamp_s: float, proposals: Proposals, located: Located) -> TrackedFrame:
        """Match a frame's proposals, regrouped where the tracks know better, with the tracks; each belongs to one.

        Args:
            stamp_s: time of the frame [s].
            proposals: proposals of the frame.
            located: the same in the world.

        Returns:
            The tracks by owner, the proposals, and which tracks want a class.
        """
        self._forget(stamp_s)
        dt_s = self._predict(stamp_s)
        matches = self.association.match(self.tracks, located.observations)
        frame = Associated(proposals, located.observations, matches)
        if self._extended:  # the paper takes proposals as they are
            frame = self._regrouping.regroup(self.tracks, frame, located.placement)
        known = self.tracks.box.take(frame.matches.rows, axis=0)
        self._associate(frame.matches.rows)
        self._update(frame.matches, frame.observations, dt_s)
        proposals = self._keep_top(frame, known)
        self._observe_rest(frame.matches.rows)
        near = self._near_rest()
        self._withdraw(near)
        at_rest = self._background(near)
        self._renew(self._expire(at_rest), at_rest, frame.matches, frame.observations)
        t = self.tracks
        return self._live.tracked(proposals, self.machine.wants_class[t.state] & t.observed)

    def confirm(self, rows: Int, confirmed: Bool) -> Tracks:
        """Lead the tracks that were classified to their next states, and return a snapshot of all tracks.

        Args:
            rows: (R,) tracks classified.
            confirmed: (R,) whether the class of each is confirmed now.
        """
        self._advance(rows, np.where(confirmed, Event.CLASSIFIED.value, Event.UNDECIDED.value))
        return self._live.save()

    def _advance(self, rows: Int, events: Event | Int) -> None:
        """Move rows to the states that events lead to, and write whether the class is final there."""
        t = self.tracks
        if not len(rows):
            return
        t.state[rows] = self.machine.transition(t.state[rows], events)
        t.final[rows] = self.machine.final[t.state[rows]]

    def _lapse_s(self, stamp_s: float) -> float:
        """Time since the last frame, zero where the clock went back."""
        last_s = self._live.stamp_s
        return 0.0 if last_s is None else max(0.0, stamp_s - last_s)

    def _coasting_s(self, frames: float) -> float:
        """Time that N frames, and some more, take."""
        return (self.config.max_missed + frames) * self._period_s

    def _forget(self, stamp_s: float) -> None:
        """Delete the tracks that would have expired in a gap; beyond N frames of it, the scene may be another one."""
        t, lapse_s, most_s = self.tracks, self._lapse_s(stamp_s), self._coasting_s(1.5)
        gone = t.unseen_s + lapse_s > most_s
        if gone.any():
            self.background_map.add(t, (gone & self._background(self._near_rest())).nonzero()[0])
            self._live.renew((~gone).nonzero()[0], 0)
        if lapse_s > most_s:
            self.background_map.clear()

    def _predict(self, stamp_s: float) -> float:
        """Equation 1, over the time since the last frame, which is returned [s]."""
        dt_s = self._lapse_s(stamp_s)
        self._live.stamp_s = stamp_s
        t = self.tracks
        creeps = dt_s < MIN_STEP_SHARE * self._period_s  # a stalled clock does not keep tracks alive
        t.unseen_s[:] += self._period_s if creeps else dt_s
        self._filter.predict(t.x, t.P, dt_s)
        return dt_s

    def _associate(self, rows: Int) -> None:
        """Count hits and misses; proposals take over the standing of their tracks, the other tracks coast."""
        t = self.tracks
        events = np.full(len(t), Event.UNASSOCIATED.value)
        events[rows] = Event.ASSOCIATED.value
        t.state[:] = self.machine.transition(t.state, events)
        t.state[rows] = self.machine.joined(t.state[rows])
        t.final[:] = self.machine.final[t.state]
        t.age[:] += 1
        t.hits[rows] += 1
        t.missed[:] += 1
        t.missed[rows], t.unseen_s[rows] = 0, 0.0
        t.proposal[:] = NONE

    def _update(self, matches: Matches, observations: Observations, dt_s: float) -> None:
        """Equation 1's filter on the matched positions, and what the proposals show of their tracks."""
        t, rows = self.tracks, matches.rows
        self._filter.update(t.x, t.P, rows, matches.position, matches.covariance)
        t.end_variance[rows] = matches.end_variance
        self._observe(t, rows, matches.proposals, observations, matches.position, dt_s)

    def _keep_top(self, frame: Associated, known: Float64) -> Proposals:
        """A person cut above is as high as in (R, 7) the boxes known before the frame: in the track and proposal."""
        t, rows, own = self.tracks, frame.matches.rows, frame.matches.proposals
        t.hidden[rows] = False
        people = IS_PERSON[t.object_class[rows]].nonzero()[0]
        people = people[frame.proposals.cut[own[people]] & Cut.TOP.value > 0]
        if not len(people):
            return frame.proposals
        rows, own, known = rows[people], own[people], known[people]
        hidden_m = np.maximum((known[:, 2] + known[:, 5] / 2) - (t.box[rows, 2] + t.box[rows, 5] / 2), 0.0)
        t.hidden[rows] = (hidden_m > 0) & (t.box[rows, 5] < PERSON_M / 2)
        raised = frame.proposals.box.copy()
        for boxes, index in ((t.box, rows), (raised, own)):
            boxes[index, 2:6:3] += np.outer(hidden_m, (0.5, 1.0))  # z of the middle, and height
        return replace(frame.proposals, box=raised)

    def _observe_rest(self, rows: Int) -> None:
        """Write rest position and stationary of the rows; a track that stopped rests where it is."""
        t = self.tracks
        x, position, hits = t.x.take(rows, axis=0), t.rest_position.take(rows, axis=0), t.hits[rows]
        stopped = ((x[:, SPEED] < STOPPED_MPS) & ~t.stationary[rows] & (hits > 3)).nonzero()[0]
        position[stopped] = x[stopped, :2]
        step = x[:, :2] - position
        near = np.hypot(step[:, 0], step[:, 1]) < STATIONARY_RADIUS_M
        t.stationary[rows] = near & (hits > 2)
        t.rest_position[rows] = position + (REST_GAIN * near)[:, None] * step
        if self._extended:
            self._filter.observe_speed(t.x, t.P, rows[near], 0.0, STATIONARY_SIGMA_MPS)

    def _near_rest(self) -> Bool:
        """(M,) tracks near their rest position."""
        step = self.tracks.x[:, :2] - self.tracks.rest_position
        near: Bool = np.hypot(step[:, 0], step[:, 1]) < STATIONARY_RADIUS_M
        return near

    def _background(self, near: Bool) -> Bool:
        """(M,) tracks that are finally background, and near their rest position."""
        background: Bool = self.tracks.object_class == ObjectClass.BACKGROUND.value
        return self.tracks.final & background & near

    def _withdraw(self, near: Bool) -> None:
        """The class of a place does not hold away from it (e12), unless a view has confirmed it."""
        t = self.tracks
        rows = (t.inherited & ~near).nonzero()[0]
        self._advance(rows[t.proposal[rows] != NONE], Event.WITHDRAWN)

    def _expire(self, at_rest: Bool) -> Int:
        """After the time of N frames a track is deleted (a9, a14), background into the map; rows (A,) kept."""
        t = self.tracks
        expired: Bool = (t.proposal == NONE) & (t.unseen_s > self._coasting_s(0.5))
        self.background_map.add(t, (expired & at_rest).nonzero()[0])
        self._advance(expired.nonzero()[0], Event.EXPIRED)
        return (~expired).nonzero()[0]

    def _renew(self, kept: Int, at_rest: Bool, matches: Matches, observations: Observations) -> None:
        """The rows kept, and a track for every proposal without one: a2, or a1 and a5 (a6) at a remembered place."""
        claimed = np.zeros(len(observations), np.bool_)
        claimed[matches.proposals] = True
        proposals = (~claimed).nonzero()[0]
        known = self.background_map.recall(self.tracks, kept[at_rest[kept]], observations, proposals)
        rows, new = self._live.renew(kept, len(proposals)), slice(len(kept), None)
        t = self.tracks
        t.state[new] = self.machine.proposal
        self._advance(rows, np.where(known, Event.ASSOCIATED.value, Event.UNASSOCIATED.value))
        self._advance(rows[known], Event.JOINS_FINAL)
        position = self.association.initial_position(observations).take(proposals, axis=0)
        t.x[new, :2] = t.rest_position[new] = position  # speed and heading begin at zero
        t.P[new] = self._P_new
        t.age[new] = t.hits[new] = 1
        t.lagged_kdop[new] = observations.kdop.T.take(proposals, axis=0)
        t.size_m[new] = observations.box.take(proposals, axis=0)[:, 3:6]
        self._observe(t, rows, proposals, observations, position, 0.0)
