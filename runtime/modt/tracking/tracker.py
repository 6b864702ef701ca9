"""The tracking stage: predict, associate, update, births and deaths (sections III-B, IV-B and V-B)."""

from __future__ import annotations

import numpy as np

from modt.config import TrackingConfig
from modt.tracking import kalman
from modt.tracking.association import Association, Matches, PaperAssociation
from modt.tracking.followed import Followed
from modt.tracking.sightings import Sightings, sight
from modt.tracking.states import Happening, StateMachine
from modt.types import NONE, Bool, Float64, Frame, Int, Proposals, Tracks

STRAIGHT_RAD = np.pi
"""Deviation of the heading of a new track: it says nothing."""


def association_of(config: TrackingConfig) -> Association:
    """The association that a configuration names."""
    return PaperAssociation(config)


class Tracker:
    """Follows every proposal from frame to frame.

    Args:
        config: its parameters.
        machine: the table that drives the states, EFFICIENT or ACCURATE.
        association: how proposals find their tracks; by default as the configuration says.
    """

    def __init__(self, config: TrackingConfig, machine: StateMachine, association: Association | None = None) -> None:
        self.config, self.machine = config, machine
        self.association = association or association_of(config)
        self._tracks = Followed.blank()
        self._next_id = 0
        self._stamp_s: float | None = None
        self._T_world_sensor = np.eye(4)

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
        return self._T_world_sensor

    def follow(self, frame: Frame, proposals: Proposals) -> Tracks:
        """Take a frame's proposals to the tracks; afterwards every proposal belongs to exactly one of them.

        Returns:
            The live table: stages that come after write their columns into it.
        """
        self._predict(frame.stamp_s)
        self._T_world_sensor = self._pose(frame)
        sightings = sight(frame, proposals, self._T_world_sensor)
        matches = self.association.match(self._tracks, sightings)
        self._update(matches, sightings)
        self._miss(matches)
        self._bear(matches, sightings)
        return self._tracks

    def asking(self) -> Bool:
        """(M,) tracks with a proposal whose state asks for a class."""
        asks: Bool = self.machine.asks[self._tracks.state] & (self._tracks.proposal != NONE)
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

    def _pose(self, frame: Frame) -> Float64:
        return self._T_world_sensor if frame.T_world_sensor is None else frame.T_world_sensor

    def _predict(self, stamp_s: float) -> None:
        """Equation 1, over the time since the last frame."""
        dt_s = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        t = self._tracks
        acceleration = np.full(len(t), self.config.acceleration_sigma_mps2)
        turn = np.full(len(t), self.config.turn_sigma_radps)
        t.x, t.P = kalman.predict(t.x, t.P, kalman.process_noise(t.x, dt_s, acceleration, turn), dt_s)

    def _update(self, matches: Matches, sightings: Sightings) -> None:
        """Equation 1's filter on the places found; a4 and a7, or a7, a9, a11 and a13."""
        t, rows = self._tracks, matches.rows
        x, P = t.x[rows], t.P[rows]
        slow = np.abs(x[:, kalman.SPEED]) < np.sqrt(P[:, kalman.SPEED, kalman.SPEED])
        step = matches.place - x[:, :2]
        heading = np.where(slow, np.arctan2(step[:, 1], step[:, 0]), x[:, kalman.HEADING])
        x, P = kalman.update(*kalman.face(x, P, heading), matches.place, matches.R)
        t.x[rows], t.P[rows] = kalman.turn_about(x, P)
        t.state[rows] = self.machine.meet(t.state[rows], Happening.ASSOCIATED)
        t.missed[rows] = 0
        t.hits[rows] += 1
        self._show(t, rows, matches.proposals, sightings)

    def _show(self, tracks: Followed, rows: Int, proposals: Int, sightings: Sightings) -> None:
        """Note what was seen of the tracks."""
        tracks.proposal[rows] = proposals
        tracks.box[rows] = sightings.box[proposals]
        tracks.points[rows] = sightings.count[proposals]
        tracks.low[rows], tracks.high[rows] = sightings.low[proposals], sightings.high[proposals]
        tracks.foot[rows], tracks.top[rows] = sightings.foot[proposals], sightings.top[proposals]
        tracks.shown[rows] = tracks.x[rows, :2]

    def _miss(self, matches: Matches) -> None:
        """Tracks without a proposal coast; after N frames they are deleted."""
        t = self._tracks
        t.age += 1
        missing = np.ones(len(t), np.bool_)
        missing[matches.rows] = False
        t.proposal[missing] = NONE
        t.missed[missing] += 1
        t.state[missing] = self.machine.meet(t.state[missing], Happening.UNASSOCIATED)
        expired = t.missed > self.config.max_missed
        t.state[expired] = self.machine.meet(t.state[expired], Happening.EXPIRED)
        if expired.any():
            self._tracks = t.take(~expired)

    def _bear(self, matches: Matches, sightings: Sightings) -> None:
        """A track for every proposal that found none; a2."""
        free = np.ones(len(sightings), np.bool_)
        free[matches.proposals] = False
        born = np.flatnonzero(free)
        new = Followed.blank(len(born))
        new.id[:] = self._next_id + np.arange(len(born))
        self._next_id += len(born)
        new.state[:] = self.machine.meet(np.full(len(born), self.machine.proposal, np.int64), Happening.UNASSOCIATED)
        new.x[:, :2] = self.association.birthplace(sightings)[born]  # speed and heading begin at zero
        new.P[:] = np.diag(
            np.square(
                [
                    self.config.position_sigma_m,
                    self.config.position_sigma_m,
                    STRAIGHT_RAD,
                    self.config.initial_speed_sigma_mps,
                ]
            )
        )
        new.age[:] = new.hits[:] = 1
        new.home[:] = new.x[:, :2]
        self._show(new, np.arange(len(born)), born, sightings)
        self._tracks = self._tracks.append(new)
