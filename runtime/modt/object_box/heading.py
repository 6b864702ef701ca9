"""Headings of objects: by their motion, and by the rectangles fitted to what stands."""

from __future__ import annotations

import math

import numpy as np

from modt.class_sizes import IS_PERSON, IS_VEHICLE, IS_WALKER, MAX_SIZE_M, USUAL_SIZE_M, USUAL_SPREAD_M
from modt.object_box.seen import Seen
from modt.object_box.tuning import HeadingTuning
from modt.object_box.vectors import dot, left_of, turned
from modt.types import Bool, Float64, Int, Motion, MotionState, ObjectBoxes

COS_45 = math.sqrt(0.5)
UNKNOWN_RAD2 = 1e6
"""Variance of a heading of which nothing is known [rad2]."""


def neighbour_headings(own: ObjectBoxes, motion: Motion, object_class: Int, tuning: HeadingTuning) -> Float64:
    """(M, 2) heading of the nearest car in line whose length was seen, for cars whose length was not, else 0.

    Cars stand in rows and drive in lanes. So a car near the axis of another one mostly has the same axis.
    """
    heading = np.zeros((len(own), 2))
    is_car = IS_VEHICLE[object_class]
    is_long = own.estimated & (own.known_m[:, 0] > MAX_SIZE_M[object_class, 1])
    unknown = (is_car & ~is_long).nonzero()[0]
    known = (is_car & is_long).nonzero()[0]
    if not len(known):
        return heading
    step = motion.x[unknown, None, :2] - motion.x[known, :2]  # (unknown, known, 2)
    ahead = own.heading[known]
    along_m = np.abs(step[:, :, 0] * ahead[:, 0] + step[:, :, 1] * ahead[:, 1])
    across_m = np.abs(step[:, :, 1] * ahead[:, 0] - step[:, :, 0] * ahead[:, 1])
    distance_m = np.where(across_m < tuning.beside_m, along_m + across_m, np.inf)
    in_line = distance_m.min(axis=1) < tuning.neighbour_m
    nearest = distance_m[in_line].argmin(axis=1)
    heading[unknown[in_line]] = ahead[nearest]
    return heading


def which_move(motion: Motion, rows: Int, tuning: HeadingTuning) -> Bool:
    """(R,) rows that move, or may move and went far enough."""
    state = motion.motion[rows]
    fast = dot(motion.velocity[rows], motion.velocity[rows]) > tuning.min_speed_mps * tuning.min_speed_mps
    went = (motion.moved_m[rows] > tuning.min_moved_m) & (state == MotionState.UNKNOWN)
    is_moving: Bool = fast & (went | (state == MotionState.MOVING))
    return is_moving


def turn_headings(state: ObjectBoxes, motion: Motion, seen: Seen, tuning: HeadingTuning) -> None:
    """Turn the headings to the fitted rectangles, then to the motion of those that move."""
    # The fit comes before the motion, which overrules it. What stands then turns by 90 degrees where its evidence
    # speaks against the axis; length and width change places with it.
    evidence = _axis_evidence(seen, tuning) + _evidence_of_neighbours(seen, tuning)
    new = ~state.estimated
    first = np.where(evidence[:, None] >= 0, seen.long_side, left_of(seen.long_side))
    state.heading[new] = first[new]
    state.heading_variance[new] = tuning.initial_sigma_rad * tuning.initial_sigma_rad
    _turn_to_fit(state, seen, evidence, tuning)
    _turn_to_motion(state, motion, seen, tuning)
    wrong = ((state.axis_evidence < -tuning.turning_evidence) & ~seen.moving).nonzero()[0]
    state.heading[wrong] = left_of(state.heading[wrong])
    state.axis_evidence[wrong] *= -1.0
    state.heading_known[wrong] = False
    state.known_m[wrong, :2] = state.known_m[wrong, 1::-1]


def _axis_evidence(seen: Seen, tuning: HeadingTuning) -> Float64:
    """(R,) log-likelihood ratio of a heading along the longer visible side over one across it.

    A side is seen whole, or a part of it. So a short one says little, one as long as usual speaks for itself, and
    a longer one speaks against itself.
    """
    length_m, width_m = seen.sides_m
    usual_m = USUAL_SIZE_M.take(seen.object_class, axis=0)
    variance = np.square(USUAL_SPREAD_M.take(seen.object_class, axis=0)) + tuning.axis_spread_m * tuning.axis_spread_m

    def likelihood(side_m: Float64, axis: int) -> Float64:
        off = side_m - usual_m[:, axis]
        square = off * off / variance[:, axis]
        part = 1 + square / 3  # a heavy tail: a shorter side may be a part of any longer one
        fitting: Float64 = tuning.whole_side_evidence / (part * part)
        return np.where(off > 0, tuning.whole_side_evidence - square / 2, fitting)

    ratio = likelihood(length_m, 0) + likelihood(width_m, 1) - likelihood(width_m, 0) - likelihood(length_m, 1)
    shoulders = -tuning.across_evidence * (length_m > tuning.shoulder_ratio * width_m)
    most = tuning.max_frame_evidence
    return np.where(IS_WALKER[seen.object_class], shoulders, np.clip(ratio, -most, most))


def _evidence_of_neighbours(seen: Seen, tuning: HeadingTuning) -> Float64:
    """(R,) evidence of the neighbours for a heading along the longer visible side.

    Positive where the neighbour stands along that side, negative where it stands across it, and 0 without one.
    """
    along = dot(seen.neighbour, seen.long_side)
    return tuning.neighbour_evidence * (2 * along * along - dot(seen.neighbour, seen.neighbour))


def _turn_to_fit(state: ObjectBoxes, seen: Seen, evidence: Float64, tuning: HeadingTuning) -> None:
    """Turn the headings to the nearest of the four directions of each rectangle, and count its evidence."""
    side = seen.long_side
    facing = dot(state.heading, side)
    beside = dot(state.heading, left_of(side))
    is_long = np.abs(facing) >= np.abs(beside)
    sign = np.where(np.where(is_long, facing, beside) < 0, -1.0, 1.0)
    nearest = sign[:, None] * np.where(is_long[:, None], side, left_of(side))
    counted = tuning.evidence_memory * state.axis_evidence + np.where(is_long, evidence, -evidence)
    state.axis_evidence[:] = np.clip(counted, -tuning.max_evidence, tuning.max_evidence)
    variance = state.heading_variance + tuning.drift_sigma_rad * tuning.drift_sigma_rad
    measured = _fit_variance(seen, tuning)
    state.heading[:], state.heading_variance[:] = turned(state.heading, variance, nearest, measured)


def _fit_variance(seen: Seen, tuning: HeadingTuning) -> Float64:
    """(R,) variances of the directions of the fitted rectangles [rad2].

    Long sides are fitted well, and rectangles wider than the class badly.
    """
    length_m = (seen.sides_m[0] - tuning.min_side_m) / tuning.full_side_m
    weight = np.clip(length_m, tuning.least_fit_weight, 1.0)
    weight *= np.where(IS_PERSON[seen.object_class], tuning.person_fit_weight, 1.0)
    weight[IS_WALKER[seen.object_class]] = tuning.pedestrian_fit_weight
    excess_m = np.maximum(seen.sides_m[1] - USUAL_SIZE_M[seen.object_class, 1], 0.0)
    excess = excess_m / USUAL_SPREAD_M[seen.object_class, 1]
    variance: Float64 = tuning.fit_sigma_rad * tuning.fit_sigma_rad * (1 + excess * excess) / weight
    return variance


def _turn_to_motion(state: ObjectBoxes, motion: Motion, seen: Seen, tuning: HeadingTuning) -> None:
    """Turn what moves to the direction of its motion, at once where that is more than 45 degrees away."""
    moving = seen.moving.nonzero()[0]
    velocity = motion.velocity[seen.rows[moving]]
    square = dot(velocity, velocity)
    direction = velocity / np.sqrt(square)[:, None]
    x, y = direction.T
    covariance = motion.velocity_covariance[seen.rows[moving]]
    across = y * y * covariance[:, 0, 0] - 2 * x * y * covariance[:, 0, 1] + x * x * covariance[:, 1, 1]
    heading = state.heading[moving]
    backward = (dot(heading, direction) < 0) & ~state.heading_known[moving]
    heading[backward] *= -1.0
    turned_away = dot(heading, direction) < COS_45
    variance = np.where(turned_away, UNKNOWN_RAD2, state.heading_variance[moving])
    measured = tuning.motion_sigma_rad * tuning.motion_sigma_rad + across / square
    state.heading[moving], state.heading_variance[moving] = turned(heading, variance, direction, measured)
    state.axis_evidence[moving] = tuning.moving_evidence
    state.heading_known[moving] = True
