"""The table of the tracks, in parts by the stage that writes them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from modt.classes import N_CLASSES
from modt.types.arrays import NONE, Bool, Float64, Int
from modt.types.columns import Columns, column
from modt.types.proposals import Proposals


class MotionState(IntEnum):
    """Whether a track moves."""

    UNKNOWN = 0
    STILL = 1
    MOVING = 2


MOTION_NAMES = tuple(state.name.lower() for state in MotionState)


@dataclass(frozen=True)
class Motion(Columns):
    """Columns of the tracker."""

    id: Int = column(int, fill=NONE)  # never used twice in a run
    state: Int = column(int)  # value of the state machine's enumeration
    final: Bool = column(bool)  # the class is confirmed in this state
    x: Float64 = column(float, 4)  # filter state x, y [m, world], heading [rad], speed [m/s] (Equation 1)
    P: Float64 = column(float, 4, 4)  # its covariance
    box: Float64 = column(float, 7)  # last box seen, world frame
    proposal: Int = column(int, fill=NONE)  # proposal in this frame, NONE while lost
    points: Int = column(int)  # points of the last proposal
    age: Int = column(int)  # frames since birth, the birth frame counting as 1
    hits: Int = column(int)  # frames with a proposal
    missed: Int = column(int)  # frames since the last proposal
    moved_m: Float64 = column(float)  # displacement from `lagged_kdop`, along the axis where both ends moved most [m]
    observed_s: Float64 = column(float)  # sum of the steps that ended with a proposal, so a gap adds its last one [s]
    size_m: Float64 = column(float, 3)  # smoothed length, width and height of the boxes seen [m]
    top_cut: Bool = column(bool)  # a person whose upper half the view cuts off
    motion: Int = column(int)  # value of MotionState
    moving_probability: Float64 = column(float, fill=0.5)  # probability that it moves
    velocity: Float64 = column(float, 2)  # velocity, about 0 of what is still [m/s, world]
    velocity_covariance: Float64 = column(float, 2, 2)  # its covariance [m2/s2]

    @property
    def observed(self) -> Bool:
        """(M,) whether the track has a proposal in this frame."""
        observed: Bool = self.proposal != NONE
        return observed

    def row_of_proposal(self, n_proposals: int) -> Int:
        """(n_proposals,) row of the track of each proposal, NONE where there is none."""
        rows = np.full(n_proposals, NONE, np.int64)
        observed = self.observed.nonzero()[0]
        rows[self.proposal[observed]] = observed
        return rows


@dataclass(frozen=True)
class Evidence(Columns):
    """Columns of the fusion: what is known of the class."""

    prior: Float64 = column(float, N_CLASSES, fill=1 / N_CLASSES)  # P(class | box) of the last box seen
    posterior: Float64 = column(float, N_CLASSES, fill=1 / N_CLASSES)  # P(class | views, boxes, motion)
    motion_evidence: Float64 = column(float, N_CLASSES)  # log P(motion | class) over that of background
    box_evidence: Float64 = column(float, N_CLASSES)  # mean log P(box | class) of the boxes seen, up to a constant
    may_be_object: Bool = column(bool)  # the last box seen and the motion allow an object
    view_evidence: Float64 = column(float, N_CLASSES)  # mean log P(view | class) of the views, up to a constant
    # Weight of the past in `view_evidence`: sum of the views' weights, discounted by `view_memory`.
    view_weight: Float64 = column(float)
    views: Int = column(int)  # views fused
    key_points: Int = column(int)  # points at the last view, 0 before any
    key_age: Int = column(int)  # age at the last view

    @property
    def viewed(self) -> Bool:
        """(M,) whether the network has classified it at least once."""
        viewed: Bool = self.key_points > 0
        return viewed


@dataclass(frozen=True)
class Requests(Columns):
    """Column of the scheduler."""

    waiting: Int = column(int)  # frames in a row in which its call was deferred; a coasting track keeps the number


@dataclass(frozen=True)
class Decisions(Columns):
    """Column of the decision."""

    object_class: Int = column(int)  # the reported class


@dataclass(frozen=True)
class ObjectBoxes(Columns):
    """Columns of the boxes of whole objects."""

    whole_box: Float64 = column(float, 7)  # box of the whole object: x, y, z, l, w, h [m], yaw [rad], world frame
    heading_known: Bool = column(bool)  # whether the yaw of `whole_box` is that of its front
    estimated: Bool = column(bool)  # the columns below have been written
    heading: Float64 = column(float, 2)  # unit vector [world]
    heading_variance: Float64 = column(float)  # variance of its angle [rad2]
    axis_evidence: Float64 = column(float)  # log-likelihood ratio of the heading over those across it
    known_m: Float64 = column(float, 3)  # length, width and height known from the views [m]
    centre_offset: Float64 = column(float, 2)  # from the position of the track to the centre of the box [m, world]


@dataclass(frozen=True)
class Tracks(ObjectBoxes, Decisions, Requests, Evidence, Motion):
    """All columns side by side, in the order of the parts from right to left."""


@dataclass(frozen=True)
class TrackedFrame:
    """Result of tracking: the tracks by owner, of which each stage writes its own part, and the frame's proposals."""

    motion: Motion  # read-only
    evidence: Evidence  # read-only
    own_evidence: Evidence  # the same arrays, written by the fusion
    requests: Requests  # written by the scheduler
    decisions: Decisions  # written by the decision
    boxes: ObjectBoxes  # written by the stage of the object boxes
    proposals: Proposals  # proposals of the frame after regrouping; each belongs to one track
    wants_class: Bool  # (M,) tracks with a proposal whose state asks for a class
