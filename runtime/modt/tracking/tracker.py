"""The tracking stage: predict, associate, update, births and deaths (sections III-B, IV-B and V-B)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.class_sizes import IS_PERSON, IS_WALKER, WHOLE_SIZE_M
from modt.classes import PERSON_HEIGHT_M, ObjectClass
from modt.config import TrackingConfig
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.observations import Located, Observations, StaticTracks
from modt.tracking.association import Associated, Association, Matches
from modt.tracking.extent import extent_update_of
from modt.tracking.hiding import Hiding
from modt.tracking.kalman import SPEED, Filter, velocity_of
from modt.tracking.kdop_association import KdopAssociation
from modt.tracking.motion_filter import motion_filter_of
from modt.tracking.paper_association import PaperAssociation
from modt.tracking.regrouping import Regrouping
from modt.tracking.sight import sight_of
from modt.tracking.states import StateEvent, StateMachine
from modt.tracking.track_table import LiveTracks, TrackTable
from modt.tracking.tuning import TrackingTuning
from modt.types import NONE, Bool, Cut, Float32, Float64, Int, MotionState, Proposals, TrackedFrame, Tracks

MIN_STEP_SHARE = 0.1
"""A time step shorter than this share of the period means a stalled clock."""
ANY, COMPACT, OBJECT = range(3)
"""Rows of the weights of evidence: any proposal, a compact one, one of a track whose class is not background."""


def association_of(config: TrackingConfig, kernels: GeometryKernels, tuning: TrackingTuning) -> Association:
    """The association that a configuration names."""
    if config.association == "paper":
        return PaperAssociation(tuning.paper_association)
    return KdopAssociation(kernels, tuning.kdop_association)


class Tracker:
    """Follows every proposal from frame to frame.

    Args:
        config: association, extensions and the frames that a track is kept without a proposal.
        machine: the table that drives the states.
        association: association of proposals with tracks; by default the configured one.
        period_s: time between sweeps; a track that is not seen is kept for `max_missed` of them.
        kernels: passes over points and pairs.
        live: tracks to go on with; by default none.
        tuning: everything that is chosen in the stage.
    """

    def __init__(
        self,
        config: TrackingConfig,
        machine: StateMachine,
        association: Association | None = None,
        period_s: float = 0.1,
        kernels: GeometryKernels = NUMPY_GEOMETRY,
        live: LiveTracks | None = None,
        tuning: TrackingTuning = TrackingTuning(),
    ) -> None:
        self.config = config
        self.machine = machine
        self.association = association_of(config, kernels, tuning) if association is None else association
        self._extended = config.extensions == "all"
        self._period_s = period_s
        self._regrouping = Regrouping(kernels, tuning)
        self._update_extent = extent_update_of(kernels, tuning.extent)
        self._filter = Filter(tuning.filter)
        position_m = tuning.filter.initial_position_sigma_m
        unknown_heading_rad = np.pi
        sigma = [position_m, position_m, unknown_heading_rad, tuning.filter.initial_speed_sigma_mps]
        self._P_new = np.diag(np.square(sigma))
        self._motion_filter = motion_filter_of(kernels, tuning.motion_filter)
        self._sight = sight_of(kernels, tuning.sight)
        self._hiding = Hiding(self._sight, tuning.hiding)
        self._evidence = evidence = tuning.motion_evidence
        # (3, 3) weight of evidence of motion, by ANY, COMPACT or OBJECT and the number of bounded sides
        self._weight_by_sides = np.array(
            [
                [1.0, evidence.one_side_weight, 0.0],
                [1.0, evidence.compact_one_side_weight, evidence.compact_two_sides_weight],
                [1.0, evidence.object_weight, evidence.object_weight],
            ]
        )
        self._rest = tuning.rest
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
        """Delete tracks that a gap has ended, and return what the odometry needs of the others."""
        self._end_after_gap(stamp_s)
        t = self.tracks
        return StaticTracks(
            id=t.id,
            observed=t.observed,
            stationary=t.stationary,
            candidate=(t.stationary | (t.hits < self._rest.min_hits)) & (t.missed <= self._rest.max_missed),
            kdop=t.kdop,
            predicted_kdop=t.predicted_kdops(),
        )

    def track(
        self, stamp_s: float, proposals: Proposals, located: Located, points: Float32 | None = None
    ) -> TrackedFrame:
        """Predict the tracks, match and regroup the proposals of a frame, and update, end and begin tracks by them.

        Each of the proposals returned belongs to one track, a new one where none matched. `confirm` ends the frame.

        Args:
            stamp_s: time of the frame [s].
            proposals: proposals of the frame.
            located: the same in the world.
            points: (N, 4) points of the frame, in which lines of sight are looked up; None if they are not known.

        Returns:
            The tracks, in parts by the stage that writes them, the proposals, and which tracks want a class.
        """
        self._end_after_gap(stamp_s)
        if self._extended:
            self._delete(self._hiding.merge_returned(self.tracks))
        dt_s = self._predict(stamp_s)
        matches = self.association.match(self.tracks, located.observations)
        frame = Associated(proposals, located.observations, matches)
        if self._extended:  # the paper takes proposals as they are
            frame = self._regrouping.regroup(self.tracks, frame, located.placement)
        nearest = self._look(points, proposals)
        rows = frame.matches.rows
        box_before = self.tracks.box.take(rows, axis=0)
        self._count_and_advance(rows)
        self._update(frame, dt_s, nearest)
        proposals = self._keep_tops(frame, box_before)
        self._observe_rest(rows)
        if nearest is not None:
            self._hiding.keep_hidden(self.tracks, nearest, located.placement.T_world_sensor, dt_s)
        kept = self._expire()
        self._begin_tracks(kept, frame.matches, frame.observations)
        t = self.tracks
        if self._extended:
            self._decide_motion()
        else:
            t.velocity[:], t.velocity_covariance[:] = velocity_of(t.x, t.P)
        return self._live.tracked(proposals, self.machine.wants_class[t.state] & t.observed)

    def confirm(self, rows: Int, confirmed: Bool) -> Tracks:
        """Lead the tracks that were classified to their next states, and return a snapshot of all tracks.

        Args:
            rows: (R,) tracks classified.
            confirmed: (R,) whether the class of each is confirmed now.
        """
        self._advance(rows, np.where(confirmed, StateEvent.CLASSIFIED.value, StateEvent.UNDECIDED.value))
        return self._live.save()

    def _advance(self, rows: Int, events: StateEvent | Int) -> None:
        """Move rows to the states that events lead to, and write whether the class is confirmed there."""
        t = self.tracks
        if not len(rows):
            return
        t.state[rows] = self.machine.transition(t.state[rows], events)
        t.final[rows] = self.machine.final[t.state[rows]]

    def _elapsed_s(self, stamp_s: float) -> float:
        """Time since the last frame [s], 0 if there is none or the clock went back."""
        last_s = self._live.stamp_s
        return 0.0 if last_s is None else max(0.0, stamp_s - last_s)

    def _max_unseen_s(self, slack_periods: float) -> float:
        """(max_missed + `slack_periods`) periods [s]; half a period of them is for the jitter of the frames."""
        return (self.config.max_missed + slack_periods) * self._period_s

    def _end_after_gap(self, stamp_s: float) -> None:
        """Delete tracks unseen for more than max_missed + 1.5 periods.

        That is a period more than in `_expire`, since the present frame may yet show them.

        An odometry that registers asks for the tracks before `track`, so this is called once or twice a frame. The
        second call changes nothing.
        """
        gone = self.tracks.unseen_s + self._elapsed_s(stamp_s) > self._max_unseen_s(1.5)
        if gone.any():
            self._live.renew((~gone).nonzero()[0], 0)

    def _delete(self, rows: Int) -> None:
        """Delete these rows."""
        if len(rows):
            self._live.renew(np.delete(np.arange(len(self.tracks)), rows), 0)

    def _predict(self, stamp_s: float) -> float:
        """Predict the tracks over the time since the last frame (Equation 1), and return that time [s]."""
        dt_s = self._elapsed_s(stamp_s)
        self._live.stamp_s = stamp_s
        t = self.tracks
        clock_stalled = dt_s < MIN_STEP_SHARE * self._period_s  # a stalled clock does not keep tracks alive
        t.unseen_s[:] += self._period_s if clock_stalled else dt_s
        if self._extended:
            self._motion_filter.predict(t, dt_s)
        else:
            self._filter.predict(t.x, t.P, dt_s)
        return dt_s

    def _look(self, points: Float32 | None, proposals: Proposals) -> Float32 | None:
        """Nearest returns of a frame (`Sight.look`); None where points or their kinds are not known, or not used."""
        if not self._extended or points is None or proposals.kind is None:
            return None
        return self._sight.look(points, proposals.kind)

    def _count_and_advance(self, rows: Int) -> None:
        """Count hits and misses, and advance the states: matched tracks are tracked, the others coast.

        No track has a proposal until `_update` writes those of the matched ones.
        """
        t = self.tracks
        events = np.full(len(t), StateEvent.UNASSOCIATED.value)
        events[rows] = StateEvent.ASSOCIATED.value
        t.state[:] = self.machine.transition(t.state, events)
        t.state[rows] = self.machine.joined(t.state[rows])
        t.final[:] = self.machine.final[t.state]
        t.age[:] += 1
        t.hits[rows] += 1
        t.reappears[rows] = t.missed[rows] > 0
        t.missed[:] += 1
        t.missed[rows] = 0
        t.unseen_s[rows] = 0.0
        t.proposal[:] = NONE

    def _update(self, frame: Associated, dt_s: float, nearest: Float32 | None) -> None:
        """Update the filter with the matched positions, and the extents with the matched proposals."""
        t = self.tracks
        matches = frame.matches
        rows = matches.rows
        if self._extended:
            covariance = self._hiding.loosened(t, frame, nearest)
            log_ratio = self._motion_filter.update(t, rows, matches.position, covariance)
            self._motion_filter.believe(t, rows, self._weighed(log_ratio, frame, nearest))
        else:
            self._filter.update(t.x, t.P, rows, matches.position, matches.covariance)
        t.end_variance[rows] = matches.end_variance
        envelope_before = t.envelope.take(frame.joined, axis=0)
        self._update_extent(t, rows, matches.proposals, frame.observations, matches.position, dt_s)
        t.centroid[rows] = frame.observations.centroid[matches.proposals]
        t.envelope[frame.joined] = envelope_before  # what is joined justifies no further joins

    def _weighed(self, log_ratio: Float64, frame: Associated, nearest: Float32 | None) -> Float64:
        """Evidence of moving (R,) of the matched tracks, less where a changing view explains it.

        Where something nearer hides an end of a proposal, or its surface continues past that end, the end may move
        though the object rests. The evidence of walkers is weak there already, as their positions are uncertain
        (`Hiding.loosened`). A flat and low proposal of a background track is no evidence of motion. Evidence of rest
        counts in any case.
        """
        tuning = self._evidence
        length_m, width_m, height_m = frame.proposals.box[frame.matches.proposals, 3:6].T
        flat = (height_m < tuning.min_height_m) & (height_m < tuning.flat_height * length_m)
        object_class = self.tracks.object_class[frame.matches.rows]
        is_object = object_class != ObjectClass.BACKGROUND.value
        weighed = np.where(flat & ~is_object, np.minimum(log_ratio, 0.0), log_ratio)
        weakened = ((weighed > 0) & ~IS_WALKER[object_class]).nonzero()[0]
        if nearest is None or not len(weakened):
            return weighed
        compact = (length_m < tuning.max_compact_m) & (width_m > tuning.min_compact_width * length_m)
        kind = np.where(is_object, OBJECT, np.where(compact, COMPACT, ANY))[weakened]
        sides = self._sight.bounded_sides(nearest, frame.proposals, frame.matches.proposals[weakened])
        weighed[weakened] *= self._weight_by_sides[kind, sides.sum(axis=1)]
        return weighed

    def _keep_tops(self, frame: Associated, box_before: Float64) -> Proposals:
        """Keep the former tops of people whose top the view cuts off, in the tracks and in the returned proposals.

        Within two metres of a low sensor its view ends at the hips. Without this the box of a person who comes near
        shrinks to the legs. Write which tracks are people whose upper half is cut off (`top_cut`): legs alone are
        not classified, are no evidence of a size, and may be joined.

        Args:
            frame: frame after regrouping.
            box_before: (R, 7) boxes of the matched tracks before the frame [m, world].
        """
        t = self.tracks
        t.top_cut[frame.matches.rows] = False
        cut_above = frame.proposals.cut[frame.matches.proposals] & Cut.TOP.value > 0
        people = (IS_PERSON[t.object_class[frame.matches.rows]] & cut_above).nonzero()[0]
        if not len(people):
            return frame.proposals
        rows = frame.matches.rows[people]
        cut_off_m = np.maximum(_top_m(box_before[people]) - _top_m(t.box[rows]), 0.0)
        t.top_cut[rows] = (cut_off_m > 0) & (t.box[rows, 5] < PERSON_HEIGHT_M / 2)
        middle_and_height = np.outer(cut_off_m, (0.5, 1.0))  # z of the middle rises by half
        t.box[rows, 2:6:3] += middle_and_height
        box = frame.proposals.box.copy()
        box[frame.matches.proposals[people], 2:6:3] += middle_and_height
        return replace(frame.proposals, box=box)

    def _observe_rest(self, rows: Int) -> None:
        """Write rest position and stationary of the rows; a track that stopped rests where it is."""
        t = self.tracks
        rest = self._rest
        x = t.x.take(rows, axis=0)
        position = t.rest_position.take(rows, axis=0)
        hits = t.hits[rows]
        stopped = ((x[:, SPEED] < rest.stopped_mps) & ~t.stationary[rows] & (hits > rest.min_hits)).nonzero()[0]
        position[stopped] = x[stopped, :2]
        step = x[:, :2] - position
        near = _is_shorter(step, rest.radius_m)
        t.stationary[rows] = near & (hits >= rest.min_hits)
        t.rest_position[rows] = position + (rest.gain * near)[:, None] * step

    def _decide_motion(self) -> None:
        """Write which tracks move and which are still, by the probability of moving and the distance gone.

        Scales `velocity_covariance` of moving tracks in place. Call it once a frame, after the filter has written it.

        What flickers seems to move from one place to another, so no track starts to move as it reappears. An object
        that moves does so until it is more likely at rest. A person who walks behind a trolley, for example, is
        partly hidden by it in most frames, and shows little evidence of motion. Occlusion shifts the visible part by
        at most the object's own length. A larger displacement therefore counts as motion even below
        `evidence.moving`. A track that more probably moves than rests, but does not count as moving, is unknown.
        """
        t = self.tracks
        evidence = self._evidence
        probable = t.moving_probability > 0.5
        was_moving = t.motion == MotionState.MOVING.value
        displacement = t.x[:, :2] - t.rest_position
        is_probable_object = probable & (t.object_class != ObjectClass.BACKGROUND.value)
        certain = t.moving_probability > evidence.moving
        certain |= is_probable_object & ~_is_shorter(displacement, WHOLE_SIZE_M[t.object_class, 0])
        moves = (certain & (was_moving | ~t.reappears)) | (is_probable_object & was_moving)
        moves &= ~_is_shorter(displacement, evidence.min_distance_m)
        is_decided = (moves | ~probable) & (t.hits >= evidence.min_hits)
        t.motion[:] = np.where(moves, MotionState.MOVING.value, MotionState.STILL.value)
        t.motion[~is_decided] = MotionState.UNKNOWN.value
        t.velocity_covariance[moves & is_decided] *= evidence.velocity_variance

    def _expire(self) -> Int:
        """End tracks unseen for more than max_missed + 0.5 periods (a9, a14, e6); returns the other rows (A,)."""
        t = self.tracks
        expired: Bool = ~t.observed & (t.unseen_s > self._max_unseen_s(0.5))
        self._advance(expired.nonzero()[0], StateEvent.EXPIRED)
        return (~expired).nonzero()[0]

    def _begin_tracks(self, kept: Int, matches: Matches, observations: Observations) -> None:
        """Keep these rows, and begin a track with each unmatched proposal (a2)."""
        matched = np.zeros(len(observations), np.bool_)
        matched[matches.proposals] = True
        proposals = (~matched).nonzero()[0]
        rows = self._live.renew(kept, len(proposals))
        new = slice(len(kept), None)  # the same rows; faster where one is enough
        t = self.tracks
        t.state[new] = self.machine.proposal
        self._advance(rows, StateEvent.UNASSOCIATED)
        position = self.association.initial_position(observations).take(proposals, axis=0)
        t.x[new, :2] = t.rest_position[new] = position  # speed and heading begin at zero
        t.P[new] = self._P_new
        if self._extended:
            self._motion_filter.begin(t, new, position)
        t.age[new] = t.hits[new] = 1
        t.lagged_kdop[new] = observations.kdop.T.take(proposals, axis=0)
        t.size_m[new] = observations.box.take(proposals, axis=0)[:, 3:6]
        t.centroid[new] = observations.centroid[proposals]
        self._update_extent(t, rows, proposals, observations, position, 0.0)


def _is_shorter(step: Float64, length_m: float | Float64) -> Bool:
    """(k,) which steps (k, 2) in the plane are shorter than a length, or than (k,) ones [m]."""
    x, y = step.T
    shorter: Bool = x * x + y * y < length_m * length_m
    return shorter


def _top_m(box: Float64) -> Float64:
    """(k,) z of the tops of boxes (k, 7) [m]."""
    top_m: Float64 = box[:, 2] + box[:, 5] / 2
    return top_m
