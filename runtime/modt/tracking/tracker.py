"""The tracking stage: predict, associate, update, births and deaths (sections III-B, IV-B and V-B)."""

from __future__ import annotations

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.config import TrackingConfig
from modt.geometry import inverse, se3
from modt.geometry.kdop import WAYS
from modt.observations import Sightings, sight
from modt.odometry import landmarks
from modt.odometry.deskew import Motion, Placing, Skew
from modt.odometry.registration import Registration
from modt.tracking import kalman
from modt.tracking.association import Association, Matches, PaperAssociation
from modt.tracking.background_map import BackgroundMemory, NoMemory
from modt.tracking.displacement import AGREE_M
from modt.tracking.fragments import outgrown, reunite
from modt.tracking.kalman import HEADING, SPEED, components_first, tracks_first
from modt.tracking.kdop_association import RobustAssociation
from modt.tracking.merging import KnownJoining
from modt.tracking.regrouping import Found, Regrouping
from modt.tracking.splitting import ExpectedParting
from modt.tracking.states import Happening, StateMachine
from modt.tracking.track_table import Followed
from modt.types import NONE, Bool, Float64, Frame, Int, Proposals, Tracks

UNKNOWN_HEADING_RAD = np.pi
"""Deviation of the heading of a new track: it says nothing."""
STILL_M = 0.5
"""What stays this near to where it was stands still."""
HOME_GAIN = 0.1
"""How fast home follows: a view that changes, or odometry that drifts, is no motion."""
STILL_SIGMA_MPS = 1.0
"""How surely what stands still has no speed, per frame."""
SLOW_MPS = 0.5
"""What is slower than this has stopped."""
FLICKER = 3
"""What is seen less often than in so many frames comes and goes."""
SHAPE_KEPT = 0.8
"""What is kept at most, a frame, of the mean outline of a track about its place."""
FORGET = 0.98
"""What is kept, a frame, of an extent that is not seen again."""
BACKGROUND = np.eye(N_CLASSES)[ObjectClass.BACKGROUND]
"""The posterior of what is background for certain."""
AGILITY = np.array([0.25, 1.5, 0.75, 1.0])
"""Process noise of each class relative to what is assumed of an unknown one."""


def association_of(config: TrackingConfig) -> Association:
    """The association that a configuration names."""
    return PaperAssociation(config) if config.association == "paper" else RobustAssociation(config)


def memory_of(config: TrackingConfig) -> NoMemory | BackgroundMemory:
    """The paper remembers nothing."""
    return NoMemory() if config.association == "paper" else BackgroundMemory()


def regroupings_of(config: TrackingConfig) -> tuple[Regrouping, ...]:
    """The paper takes proposals as they are."""
    return () if config.association == "paper" else (ExpectedParting(), KnownJoining())


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
        memory: NoMemory | BackgroundMemory | None = None,
        regroupings: tuple[Regrouping, ...] | None = None,
    ) -> None:
        self.config, self.machine = config, machine
        self.association = association_of(config) if association is None else association
        self.memory = memory_of(config) if memory is None else memory
        self.regroupings = regroupings_of(config) if regroupings is None else regroupings
        self._registration = Registration()
        place, speed = config.position_sigma_m, config.initial_speed_sigma_mps
        self._P_born = np.diag(np.square([place, place, UNKNOWN_HEADING_RAD, speed]))
        self._tracks = Followed.blank()
        self._proposals = Proposals.empty()
        self._next_id = 0
        self._stamp_s: float | None = None
        self._T_world_before = np.eye(4)
        self._placing = Placing(np.eye(4))
        self._T_world_odometry: Float64 | None = None
        self._restarts = 0
        self._first: Skew | None = None

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
        sightings = self._sight(frame, proposals)
        self._predict(frame.stamp_s)
        matches = reunite(self._tracks, sightings, self.association.match(self._tracks, sightings))
        found = Found(proposals, sightings, matches)
        for regrouping in self.regroupings:
            found = regrouping.regroup(self._tracks, found, self._placing)
        self._proposals, sightings, matches = found.proposals, found.sightings, found.matches
        self._update(matches, sightings)
        self._rest(matches.rows)
        self._miss(matches.rows)
        self._doubt()
        self._renew(matches, sightings)
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
        happening = np.where(certain, Happening.CLASSIFIED, self._undecided(rows))
        self._tracks.state[rows] = self.machine.meet(self._tracks.state[rows], happening)

    def _undecided(self, rows: Int) -> Int:
        """What a classification without certainty is to each row: Table I knows no doubt."""
        answers = self.machine.answer[self._tracks.state[rows], Happening.UNDECIDED] != NONE
        return np.where(answers, Happening.UNDECIDED, Happening.CLASSIFIED)

    def _predict(self, stamp_s: float) -> None:
        """Equation 1, over the time since the last frame."""
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        t = self._tracks
        t.kind = t.object_class
        settled = t.final & ((t.kind != ObjectClass.BACKGROUND.value) | (apart(t.x, t.home) < STILL_M))
        agility = np.where(settled, AGILITY[t.kind], 1.0)  # background that went away was none
        acceleration = agility * self.config.acceleration_sigma_mps2
        turn = agility * self.config.turn_sigma_radps
        t.x, t.P = tracks_first(*kalman.predict(*components_first(t.x, t.P), dt_s, acceleration, turn))

    def _sight(self, frame: Frame, proposals: Proposals) -> Sightings:
        """The proposals in the world; where no odometry says how the sensor moved, they do themselves."""
        before, given, first = self._placing.T_world_sensor, frame.T_world_sensor, self._stamp_s is None
        if frame.restarts != self._restarts:
            self._restarts, self._T_world_odometry = frame.restarts, None
        if first and given is not None:
            before, self._T_world_odometry = given, np.eye(4)  # the world of the odometry is that of the tracks
        skew = Skew.of(proposals, frame.turn_s)
        dt_s = 0.0 if self._stamp_s is None else frame.stamp_s - self._stamp_s
        if 2 * dt_s < abs(frame.turn_s):  # so short that errors of the poses would be drawn out: no motion
            dt_s = np.inf

        def placed(after: Float64) -> Placing:
            return Placing(after, Motion.between(before, after, dt_s), frame.turn_s)

        def seen(placing: Placing) -> Sightings:
            """The proposals in the world, where they stand at the stamp."""
            sightings = sight(proposals, placing.T_world_sensor)
            if skew is None or first:
                return sightings
            return sightings.moved(skew.step(placing.motion, placing.T_world_sensor))

        def corrected(placing: Placing) -> Placing:
            """By the registration of what is seen."""
            share = 1.0 if skew is None or self._first is not None else skew.share(dt_s)  # the first frame goes along
            correction = self._registration.correct(self._tracks, seen(placing), share)
            return placed(rigid(correction @ placing.T_world_sensor))

        if given is not None and self._T_world_odometry is not None:
            landmarks.forget(self._tracks)
            placing = placed(self._T_world_odometry @ given)
            self._mend_first(placing.motion)
        else:
            landmarks.keep(self._tracks)
            predicted = placed(before @ (inverse(self._T_world_before) @ before))  # as it moved last
            placing = corrected(predicted)
            self._mend_first(placing.motion)
            if skew is not None and not placing.motion.skews_like(predicted.motion, frame.turn_s):
                found, placing = placing, corrected(placing)  # what was registered stands elsewhere
                self._mend_first(placing.motion, instead=found.motion)
            if given is not None:  # odometry that begins late, or anew, is brought to where the tracks are
                self._T_world_odometry = placing.T_world_sensor @ inverse(given)
        self._placing, self._T_world_before = placing, before
        self._first = skew if first else None
        return seen(placing)

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

    def _update(self, matches: Matches, sightings: Sightings) -> None:
        """Equation 1's filter on the places found; a4 and a7, or a7, a9, a11 and a13."""
        t, rows = self._tracks, matches.rows
        x, P = components_first(t.x.take(rows, axis=0), t.P.take(rows, axis=0))
        z, R = components_first(matches.place, matches.covariance)
        slow = np.abs(x[SPEED]) < np.sqrt(P[SPEED, SPEED])
        step_x, step_y = z - x[:2]
        heading = np.where(slow, np.arctan2(step_y, step_x), x[HEADING])
        x, P = kalman.update(*kalman.face(x, P, heading), z, R)
        t.x[rows], t.P[rows] = tracks_first(*kalman.turn_about(x, P))
        t.state[rows] = self.machine.meet(t.state[rows], Happening.ASSOCIATED)
        t.missed[rows] = 0
        t.hits[rows] += 1
        t.doubt[rows] = matches.doubt
        about = self._show(rows, matches.proposals, sightings, matches.place)
        known = t.hull.take(rows, axis=0)
        hull = np.maximum(about, FORGET * known + (1 - FORGET) * about)
        merged = outgrown(t.kind[rows], about)
        hull[merged] = known[merged]
        t.hull[rows] = hull
        off = t.shape.take(rows, axis=0) - about
        kept = np.minimum(1.0 - 1.0 / t.hits[rows], SHAPE_KEPT)[:, None]
        t.shape[rows] = about + (np.abs(off) < AGREE_M) * kept * off

    def _show(self, rows: Int, proposals: Int, sightings: Sightings, place: Float64) -> Float64:
        """Note what is seen of tracks (R,) at their places (R, 2); returns (R, 8) their outlines about these [m]."""
        t = self._tracks
        outline = sightings.outline.T.take(proposals, axis=0)
        t.shown[rows], t.outline[rows], t.proposal[rows] = place, outline, proposals
        t.box[rows] = sightings.box.take(proposals, axis=0)
        t.points[rows] = sightings.count[proposals]
        t.foot[rows], t.top[rows] = sightings.foot[proposals], sightings.top[proposals]
        about: Float64 = outline - place @ WAYS
        return about

    def _rest(self, rows: Int) -> None:
        """What stays where it was has no speed; what has stopped is at home where it is."""
        t = self._tracks
        x, home, hits = t.x.take(rows, axis=0), t.home.take(rows, axis=0), t.hits[rows]
        stopped = ((x[:, SPEED] < SLOW_MPS) & ~t.still[rows] & (hits > 3)).nonzero()[0]
        home[stopped] = x[stopped, :2]
        stays = apart(x, home) < STILL_M
        t.still[rows] = stays & (hits > 2)
        t.home[rows] = home + HOME_GAIN * stays[:, None] * (x[:, :2] - home)
        near = rows[stays]
        x, P = components_first(x.compress(stays, axis=0), t.P.take(near, axis=0))
        t.x[near], t.P[near] = tracks_first(*kalman.observe_speed(x, P, 0.0, STILL_SIGMA_MPS))

    def _miss(self, matched: Int) -> None:
        """Tracks without a proposal coast."""
        t = self._tracks
        t.age += 1
        seen = np.zeros(len(t), np.bool_)
        seen[matched] = True
        missing = (~seen).nonzero()[0]
        t.proposal[missing] = NONE
        t.missed[missing] += 1
        t.state[missing] = self.machine.meet(t.state[missing], Happening.UNASSOCIATED)

    def _doubt(self) -> None:
        """A class inherited from a place does not hold away from it."""
        t = self._tracks
        t.inherited &= ~t.viewed  # what a view said holds anywhere
        rows = (t.inherited & (t.proposal != NONE)).nonzero()[0]
        rows = rows[apart(t.x.take(rows, axis=0), t.home.take(rows, axis=0)) > STILL_M]
        if not len(rows):
            return
        t.state[rows] = self.machine.meet(t.state[rows], Happening.DOUBTED)
        t.inherited[rows] = t.final[rows] = False
        t.posterior[rows] = 1.0 / N_CLASSES

    def _renew(self, matches: Matches, sightings: Sightings) -> None:
        """Deaths, and a track for every proposal that found none; a2, or a1 and a5 where its place is remembered."""
        claimed = np.zeros(len(sightings), np.bool_)
        claimed[matches.proposals] = True
        born = (~claimed).nonzero()[0]
        scenery = self._scenery()
        known = self.memory.recall(self._tracks, scenery, sightings, born)
        alive = self._bury(scenery)
        t = self._tracks = self._tracks.renewed(alive, len(born))
        new = np.arange(len(alive), len(t))
        t.id[new] = self._next_id + np.arange(len(born))
        self._next_id += len(born)
        happening = np.where(known, Happening.ASSOCIATED.value, Happening.UNASSOCIATED.value)
        t.state[new] = self.machine.meet(np.full(len(born), self.machine.proposal), happening)
        heir = new[known]
        t.state[heir] = self.machine.meet(t.state[heir], Happening.INHERITS_CLASS)
        t.inherited[heir] = t.final[heir] = True
        t.posterior[heir] = BACKGROUND
        place = self.association.birthplace(sightings)[born]
        t.x[new, :2] = t.home[new] = place  # speed and heading begin at zero
        t.P[new] = self._P_born
        t.age[new] = t.hits[new] = 1
        t.hull[new] = t.shape[new] = self._show(new, born, sightings, place)

    def _bury(self, scenery: Int) -> Int:
        """After N frames without a proposal a track is deleted; a9, a14. Of background its place is remembered.

        What flickers is deleted after half as many.

        Returns:
            (A,) rows that live on.
        """
        t = self._tracks
        patience = np.where(t.hits < FLICKER, self.config.max_missed // 2, self.config.max_missed)
        expired = t.missed > patience
        rows = expired.nonzero()[0]
        t.state[rows] = self.machine.meet(t.state[rows], Happening.EXPIRED)
        self.memory.keep(t, scenery[expired[scenery]])
        return (~expired).nonzero()[0]

    def _scenery(self) -> Int:
        """Rows that are background, for certain, and never moved."""
        t = self._tracks
        plain = t.kind == ObjectClass.BACKGROUND.value  # arrays are slow to compare with an enumeration itself
        rows: Int = (t.final & plain & (apart(t.x, t.home) < STILL_M)).nonzero()[0]
        return rows


def apart(x: Float64, home: Float64) -> Float64:
    """(R,) how far states (R, 4) are from their homes (R, 2) [m]."""
    step = x[:, :2] - home
    away: Float64 = np.hypot(step[:, 0], step[:, 1])
    return away
