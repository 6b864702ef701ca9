"""The tracking stage: predict, associate, update, births and deaths (sections III-B, IV-B and V-B)."""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.config import TrackingConfig
from modt.geometry import inverse, se3
from modt.geometry.kdop import DIRECTIONS
from modt.observations import Observations, observe
from modt.odometry import landmarks
from modt.odometry.deskew import Motion, Placement, SweepSkew
from modt.odometry.registration import Registration
from modt.tracking import kalman
from modt.tracking.association import Association, Matches, PaperAssociation
from modt.tracking.background_map import BackgroundMap, NoBackgroundMap
from modt.tracking.displacement import AGREE_M
from modt.tracking.fragments import oversized, reunite_fragments
from modt.tracking.kalman import HEADING, SPEED, components_first, tracks_first
from modt.tracking.kdop_association import KdopAssociation
from modt.tracking.merging import KnownCarMerge
from modt.tracking.regrouping import Found, Regrouping
from modt.tracking.splitting import ExpectedSplit
from modt.tracking.states import Event, StateMachine
from modt.tracking.track_table import TrackTable
from modt.types import NONE, Bool, Float64, Frame, Int, Proposals, Tracks

UNKNOWN_HEADING_RAD = np.pi
"""Deviation of the heading of a new track: it says nothing."""
STATIONARY_RADIUS_M = 0.5
"""What stays this near to where it was stands still."""
REST_GAIN = 0.1
"""How fast home follows: a view that changes, or odometry that drifts, is no motion."""
STATIONARY_SIGMA_MPS = 1.0
"""How surely what stands still has no speed, per frame."""
STOPPED_MPS = 0.5
"""What is slower than this has stopped."""
MIN_HITS = 3
"""What is seen less often than in so many frames comes and goes."""
MEAN_KDOP_DECAY = 0.8
"""What is kept at most, a frame, of the mean outline of a track about its place."""
ENVELOPE_DECAY = 0.98
"""What is kept, a frame, of an extent that is not seen again."""
BACKGROUND = np.eye(N_CLASSES)[ObjectClass.BACKGROUND]
"""The posterior of what is background for certain."""
AGILITY = np.array([0.25, 1.5, 0.75, 1.0])
"""Process noise of each class relative to what is assumed of an unknown one."""


def association_of(config: TrackingConfig) -> Association:
    """The association that a configuration names."""
    return PaperAssociation(config) if config.association == "paper" else KdopAssociation(config)


def memory_of(config: TrackingConfig) -> NoBackgroundMap | BackgroundMap:
    """The paper remembers nothing."""
    return NoBackgroundMap() if config.association == "paper" else BackgroundMap()


def regroupings_of(config: TrackingConfig) -> tuple[Regrouping, ...]:
    """The paper takes proposals as they are."""
    return () if config.association == "paper" else (ExpectedSplit(), KnownCarMerge())


def rigid(T: Float64) -> Float64:
    """(4, 4) nearest rigid transform: a pose that is its predecessor's product would drift from being one."""
    U, _, Vt = np.linalg.svd(T[:3, :3])
    return se3(U @ Vt, T[:3, 3])


class Tracker:
    """Follows every proposal from frame to frame.

    Args:
        config: its parameters.
        machine: the table that drives the states, EFFICIENT or ACCURATE.
        association: how proposals find their tracks; by default as the configuration says.
        memory: what is kept of background that is gone; by default nothing with the paper's association.
        regroupings: how proposals are put right, joining last, since it leaves no coordinates; by default not at all
            with the paper's association.
    """

    def __init__(
        self,
        config: TrackingConfig,
        machine: StateMachine,
        association: Association | None = None,
        background_map: NoBackgroundMap | BackgroundMap | None = None,
        regroupings: tuple[Regrouping, ...] | None = None,
    ) -> None:
        self.config, self.machine = config, machine
        self.association = association_of(config) if association is None else association
        self.background_map = memory_of(config) if background_map is None else background_map
        self.regroupings = regroupings_of(config) if regroupings is None else regroupings
        self._registration = Registration()
        position, speed = config.position_sigma_m, config.initial_speed_sigma_mps
        self._P_born = np.diag(np.square([position, position, UNKNOWN_HEADING_RAD, speed]))
        self._tracks = TrackTable.blank()
        self._proposals = Proposals.empty()
        self._next_id = 0
        self._stamp_s: float | None = None
        self._T_world_before = np.eye(4)
        self._placing = Placement(np.eye(4))
        self._T_world_odometry: Float64 | None = None
        self._restarts = 0
        self._first: SweepSkew | None = None

    @property
    def tracks(self) -> Tracks:
        """The live table."""
        return self._tracks

    @property
    def state_names(self) -> tuple[str, ...]:
        """Name of each value of tracks.state."""
        return self.machine.names

    @property
    def T_world_sensor(self) -> Float64:
        """(4, 4) pose that the last frame was placed by."""
        return self._placing.T_world_sensor

    @property
    def proposals(self) -> Proposals:
        """Those that the tracks were taken to last: the frame's, parted and joined where need be."""
        return self._proposals

    def follow(self, frame: Frame, proposals: Proposals) -> Tracks:
        """Take a frame's proposals, put right by what is known, to the tracks; afterwards each belongs to one.

        Returns:
            The live table: stages that come after write their columns into it.
        """
        observations = self._sight(frame, proposals)
        self._predict(frame.stamp_s)
        matches = reunite_fragments(self._tracks, observations, self.association.match(self._tracks, observations))
        found = Found(proposals, observations, matches)
        for regrouping in self.regroupings:
            found = regrouping.regroup(self._tracks, found, self._placing)
        self._proposals, observations, matches = found.proposals, found.observations, found.matches
        self._update(matches, observations)
        self._rest(matches.rows)
        self._miss(matches.rows)
        self._doubt()
        self._renew(matches, observations)
        return self._tracks

    def asking(self) -> Bool:
        """(M,) tracks with a proposal whose state asks for a class; what flickers does not live to ask."""
        t = self._tracks
        asks: Bool = self.machine.asks[t.state] & (t.proposal != NONE) & (t.hits >= self.config.ask_from)
        return asks

    def settle(self, rows: Int, certain: Bool) -> None:
        """Tell the machine which tracks were classified: rows (R,), and which of them are certain now (R,).

        Tracks whose state does not ask are left as they are (a mode that classifies everything does so without
        the machine).
        """
        certain = np.asarray(certain, np.bool_)
        asked = self.machine.asks[self._tracks.state[rows]]
        rows, certain = rows[asked], certain[asked]
        event = np.where(certain, Event.CLASSIFIED, self._undecided(rows))
        self._tracks.state[rows] = self.machine.transition(self._tracks.state[rows], event)

    def _undecided(self, rows: Int) -> Int:
        """What a classification without certainty is to each row: Table I knows no doubt."""
        answers = self.machine.answer[self._tracks.state[rows], Event.UNDECIDED] != NONE
        return np.where(answers, Event.UNDECIDED, Event.CLASSIFIED)

    def _predict(self, stamp_s: float) -> None:
        """Equation 1, over the time since the last frame."""
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        t = self._tracks
        t.last_class = t.object_class
        settled = t.final & (
            (t.last_class != ObjectClass.BACKGROUND.value) | (apart(t.x, t.rest_position) < STATIONARY_RADIUS_M)
        )
        agility = np.where(settled, AGILITY[t.last_class], 1.0)  # background that went away was none
        acceleration = agility * self.config.acceleration_sigma_mps2
        turn = agility * self.config.turn_sigma_radps
        t.x, t.P = tracks_first(*kalman.predict(*components_first(t.x, t.P), dt_s, acceleration, turn))

    def _sight(self, frame: Frame, proposals: Proposals) -> Observations:
        """The proposals in the world; where no odometry says how the sensor moved, they do themselves."""
        before, given, first = self._placing.T_world_sensor, frame.T_world_sensor, self._stamp_s is None
        if frame.restarts != self._restarts:
            self._restarts, self._T_world_odometry = frame.restarts, None
        if first and given is not None:
            before, self._T_world_odometry = given, np.eye(4)  # the world of the odometry is that of the tracks
        skew = SweepSkew.of(proposals, frame.turn_s)
        dt_s = 0.0 if self._stamp_s is None else frame.stamp_s - self._stamp_s
        if 2 * dt_s < abs(frame.turn_s):  # so short that errors of the poses would be drawn out: no motion
            dt_s = np.inf

        def placed(after: Float64) -> Placement:
            return Placement(after, Motion.between(before, after, dt_s), frame.turn_s)

        def seen(placement: Placement) -> Observations:
            """The proposals in the world, where they stand at the stamp."""
            observations = observe(proposals, placement.T_world_sensor)
            if skew is None or first:
                return observations
            return observations.moved(skew.step(placement.motion, placement.T_world_sensor))

        def corrected(placement: Placement) -> Placement:
            """By the registration of what is seen."""
            share = 1.0 if skew is None or self._first is not None else skew.share(dt_s)  # the first frame goes along
            correction = self._registration.correct(self._tracks, seen(placement), share)
            return placed(rigid(correction @ placement.T_world_sensor))

        if given is not None and self._T_world_odometry is not None:
            landmarks.forget(self._tracks)
            placement = placed(self._T_world_odometry @ given)
            self._mend_first(placement.motion)
        else:
            landmarks.keep(self._tracks)
            predicted = placed(before @ (inverse(self._T_world_before) @ before))  # as it moved last
            placement = corrected(predicted)
            self._mend_first(placement.motion)
            if skew is not None and not placement.motion.skews_like(predicted.motion, frame.turn_s):
                found, placement = placement, corrected(placement)  # what was registered stands elsewhere
                self._mend_first(placement.motion, instead=found.motion)
            if given is not None:  # odometry that begins late, or anew, is brought to where the tracks are
                self._T_world_odometry = placement.T_world_sensor @ inverse(given)
        self._placing, self._T_world_before = placement, before
        self._first = skew if first else None
        return seen(placement)

    def _mend_first(self, motion: Motion, instead: Motion | None = None) -> None:
        """Put what the first frame showed where it stood: how the sensor moved is known from the second one on.

        Args:
            motion: of the sensor since.
            instead: one by which it was put before.
        """
        if self._first is not None:
            step = self._first.step(motion, self._placing.T_world_sensor)
            if instead is not None:
                step -= self._first.step(instead, self._placing.T_world_sensor)
            self._tracks.move(step[self._tracks.proposal])

    def _update(self, matches: Matches, observations: Observations) -> None:
        """Equation 1's filter on the places found; a4 and a7, or a7, a9, a11 and a13."""
        t, rows = self._tracks, matches.rows
        x, P = components_first(t.x.take(rows, axis=0), t.P.take(rows, axis=0))
        z, R = components_first(matches.position, matches.covariance)
        slow = np.abs(x[SPEED]) < np.sqrt(P[SPEED, SPEED])
        step_x, step_y = z - x[:2]
        heading = np.where(slow, np.arctan2(step_y, step_x), x[HEADING])
        x, P = kalman.update(*kalman.face(x, P, heading), z, R)
        t.x[rows], t.P[rows] = tracks_first(*kalman.turn_about(x, P))
        t.state[rows] = self.machine.transition(t.state[rows], Event.ASSOCIATED)
        t.missed[rows] = 0
        t.hits[rows] += 1
        t.end_variance[rows] = matches.end_variance
        about = self._show(rows, matches.proposals, observations, matches.position)
        known = t.envelope.take(rows, axis=0)
        envelope = np.maximum(about, ENVELOPE_DECAY * known + (1 - ENVELOPE_DECAY) * about)
        merged = oversized(t.last_class[rows], about)
        envelope[merged] = known[merged]
        t.envelope[rows] = envelope
        off = t.mean_kdop.take(rows, axis=0) - about
        kept = np.minimum(1.0 - 1.0 / t.hits[rows], MEAN_KDOP_DECAY)[:, None]
        t.mean_kdop[rows] = about + (np.abs(off) < AGREE_M) * kept * off

    def _show(self, rows: Int, proposals: Int, observations: Observations, position: Float64) -> Float64:
        """Note what is seen of tracks (R,) at their places (R, 2); returns (R, 8) their outlines about these [m]."""
        t = self._tracks
        kdop = observations.kdop.T.take(proposals, axis=0)
        t.anchor[rows], t.kdop[rows], t.proposal[rows] = position, kdop, proposals
        t.box[rows] = observations.box.take(proposals, axis=0)
        t.points[rows] = observations.count[proposals]
        t.bottom[rows], t.top[rows] = observations.bottom[proposals], observations.top[proposals]
        about: Float64 = kdop - position @ DIRECTIONS
        return about

    def _rest(self, rows: Int) -> None:
        """What stays where it was has no speed; what has stopped is at home where it is."""
        t = self._tracks
        x, rest_position, hits = t.x.take(rows, axis=0), t.rest_position.take(rows, axis=0), t.hits[rows]
        stopped = ((x[:, SPEED] < STOPPED_MPS) & ~t.stationary[rows] & (hits > 3)).nonzero()[0]
        rest_position[stopped] = x[stopped, :2]
        stays = apart(x, rest_position) < STATIONARY_RADIUS_M
        t.stationary[rows] = stays & (hits > 2)
        t.rest_position[rows] = rest_position + REST_GAIN * stays[:, None] * (x[:, :2] - rest_position)
        near = rows[stays]
        x, P = components_first(x.compress(stays, axis=0), t.P.take(near, axis=0))
        t.x[near], t.P[near] = tracks_first(*kalman.observe_speed(x, P, 0.0, STATIONARY_SIGMA_MPS))

    def _miss(self, matched: Int) -> None:
        """Tracks without a proposal coast."""
        t = self._tracks
        t.age += 1
        seen = np.zeros(len(t), np.bool_)
        seen[matched] = True
        missing = (~seen).nonzero()[0]
        t.proposal[missing] = NONE
        t.missed[missing] += 1
        t.state[missing] = self.machine.transition(t.state[missing], Event.UNASSOCIATED)

    def _doubt(self) -> None:
        """A class inherited from a place does not hold away from it."""
        t = self._tracks
        t.inherited &= ~t.viewed  # what a view said holds anywhere
        rows = (t.inherited & (t.proposal != NONE)).nonzero()[0]
        rows = rows[apart(t.x.take(rows, axis=0), t.rest_position.take(rows, axis=0)) > STATIONARY_RADIUS_M]
        if not len(rows):
            return
        t.state[rows] = self.machine.transition(t.state[rows], Event.DOUBTED)
        t.inherited[rows] = t.final[rows] = False
        t.posterior[rows] = 1.0 / N_CLASSES

    def _renew(self, matches: Matches, observations: Observations) -> None:
        """Deaths, and a track for every proposal that found none; a2, or a1 and a5 where its place is remembered."""
        claimed = np.zeros(len(observations), np.bool_)
        claimed[matches.proposals] = True
        born = (~claimed).nonzero()[0]
        scenery = self._scenery()
        known = self.background_map.recall(self._tracks, scenery, observations, born)
        alive = self._bury(scenery)
        t = self._tracks = self._tracks.renewed(alive, len(born))
        new = np.arange(len(alive), len(t))
        t.id[new] = self._next_id + np.arange(len(born))
        self._next_id += len(born)
        event = np.where(known, Event.ASSOCIATED.value, Event.UNASSOCIATED.value)
        t.state[new] = self.machine.transition(np.full(len(born), self.machine.proposal), event)
        heir = new[known]
        t.state[heir] = self.machine.transition(t.state[heir], Event.INHERITS_CLASS)
        t.inherited[heir] = t.final[heir] = True
        t.posterior[heir] = BACKGROUND
        position = self.association.initial_position(observations)[born]
        t.x[new, :2] = t.rest_position[new] = position  # speed and heading begin at zero
        t.P[new] = self._P_born
        t.age[new] = t.hits[new] = 1
        t.envelope[new] = t.mean_kdop[new] = self._show(new, born, observations, position)

    def _bury(self, scenery: Int) -> Int:
        """After N frames without a proposal a track is deleted; a9, a14. Of background its place is remembered.

        What flickers is deleted after half as many.

        Returns:
            (A,) rows that live on.
        """
        t = self._tracks
        patience = np.where(t.hits < MIN_HITS, self.config.max_missed // 2, self.config.max_missed)
        expired = t.missed > patience
        rows = expired.nonzero()[0]
        t.state[rows] = self.machine.transition(t.state[rows], Event.EXPIRED)
        self.background_map.keep(t, scenery[expired[scenery]])
        return (~expired).nonzero()[0]

    def _scenery(self) -> Int:
        """Rows that are background, for certain, and never moved."""
        t = self._tracks
        plain = t.last_class == ObjectClass.BACKGROUND.value  # arrays are slow to compare with an enumeration itself
        rows: Int = (t.final & plain & (apart(t.x, t.rest_position) < STATIONARY_RADIUS_M)).nonzero()[0]
        return rows


def apart(x: Float64, rest_position: Float64) -> Float64:
    """(R,) how far states (R, 4) are from their homes (R, 2) [m]."""
    step = x[:, :2] - rest_position
    away: Float64 = np.hypot(step[:, 0], step[:, 1])
    return away
