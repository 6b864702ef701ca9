"""Proposals and tracks of one frame against its labelled objects, by the points that they share.

What is compared and what is ignored is written down in docs/evaluation.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.evaluation.frame import JudgedFrame
from modt.evaluation.overlap import Overlap, in_box_frame, inside
from modt.evaluation.rows import Association, Judged, ObjectRows, Outcome, ProposalRows
from modt.evaluation.rules import Rules
from modt.evaluation.truth import Role
from modt.types import CLASS_NAMES, N_CLASSES, NONE, Bool, Float32, Float64, Int

PARKED_PAD_M = 0.4
"""Proposals lie in a parked car's box up to this beyond it."""


def judge(frame: JudgedFrame, rules: Rules, drive: int = 0) -> Judged:
    """Compare a frame with its truth."""
    truth, overlap = frame.truth, Overlap.of(frame)
    owners = _Owners.of(frame, len(overlap.size))
    scope = _Scope.of(frame, overlap, rules)
    best = overlap.best
    said, outcome = np.append(frame.said, NONE)[owners.row], _outcome(overlap)
    enough = overlap.count >= rules.min_points
    wanted = enough & (truth.role != Role.IGNORED)
    objects = ObjectRows(
        drive=np.full(len(best), drive),
        frame=np.full(len(best), frame.index),
        id=truth.id,
        type_=np.array(truth.type_, np.object_),
        object_class=truth.object_class,
        role=truth.role,
        range_m=scope.range_m,
        cut=~scope.in_view & (scope.range_m <= rules.max_range_m) & wanted,
        to_segment=scope.to_segment & wanted,
        to_classify=scope.to_classify,
        to_follow=scope.to_follow,
        outcome=outcome,
        said=np.where(outcome == Outcome.FOUND, said[best], NONE),
        track=np.where(overlap.most > 0, owners.track[best], NONE),
    )
    proposals = _proposals(frame, overlap, scope, rules)
    tracked = owners.track != NONE
    posterior = np.append(frame.posterior, np.zeros((1, N_CLASSES)), axis=0)[owners.row]
    rows = ProposalRows(
        drive=np.full(len(said), drive),
        frame=np.full(len(said), frame.index),
        track=owners.track,
        range_m=proposals.range_m,
        posterior=posterior,
        said=said,
        label=proposals.label,
        owner=proposals.owner,
        to_classify=proposals.to_classify,
        to_call=proposals.to_call,
    )
    union = overlap.size + overlap.count[:, None] - overlap.shared
    similarity = overlap.shared / np.maximum(union, 1)
    associations = []
    for c in range(1, len(CLASS_NAMES)):
        i = np.flatnonzero(scope.to_classify & (truth.object_class == c))
        k = np.flatnonzero(tracked & proposals.to_associate & (said == c))
        associations.append(Association(truth.id[i], owners.track[k], similarity[np.ix_(i, k)]))
    return Judged(objects, rows.take(tracked), tuple(associations))


@dataclass(frozen=True, slots=True)
class _Owners:
    """Of each proposal: row of the track that owns it in the frame's columns, and its identity; NONE for no track."""

    row: Int
    track: Int

    @classmethod
    def of(cls, frame: JudgedFrame, p: int) -> _Owners:
        row = np.full(p, NONE, np.int64)
        row[frame.of_track] = np.arange(len(frame.track))
        return cls(row, np.append(frame.track, NONE)[row])


@dataclass(frozen=True, slots=True)
class _Scope:
    """Of each object: range [m], whether most of it is in view, and whether it is judged, and for what."""

    range_m: Float64
    in_view: Bool
    to_segment: Bool
    to_classify: Bool
    to_follow: Bool

    @classmethod
    def of(cls, frame: JudgedFrame, overlap: Overlap, rules: Rules) -> _Scope:
        truth, whole = frame.truth, "cut" not in rules.ignored
        range_m = np.hypot(*(truth.box[:, :2] - truth.T_box_sensor[:2, 3]).T)
        shown = [frame.points[points] for points in overlap.own]
        in_view = np.array([_most(frame.fov.contains(points)) for points in shown], np.bool_)
        in_sector = np.array([_most(_in_sector(points, rules)) for points in shown], np.bool_)
        near, foreground = range_m <= rules.max_range_m, (truth.object_class > 0) & (truth.role != Role.IGNORED)
        to_follow = near & foreground & (overlap.count >= rules.min_points_followed)
        to_segment = near & (in_view | whole)
        to_classify = to_follow & to_segment & (in_sector | whole) & (truth.role == Role.COUNTED)
        return cls(range_m, in_view, to_segment, to_classify, to_follow)


@dataclass(frozen=True, slots=True)
class _Judgement:
    """Of each proposal, as in ProposalRows; and whether it stands in associations."""

    range_m: Float64
    label: Int
    owner: Int
    to_classify: Bool
    to_call: Bool
    to_associate: Bool


def _proposals(frame: JudgedFrame, overlap: Overlap, scope: _Scope, rules: Rules) -> _Judgement:
    truth, size, best = frame.truth, overlap.size, overlap.best
    members = np.flatnonzero(frame.proposal >= 0)
    of, points = frame.proposal[members], frame.points[members]

    def most(which: Bool) -> Bool:
        """(P,) whether more than half of each proposal's points are so."""
        enough: Bool = np.bincount(of[which], minlength=len(size)) > 0.5 * size
        return enough

    # The object that a proposal stands for, and the one in whose box it lies.
    pairs = overlap.iou > 0.5 if rules.by_iou else overlap.most_of_object & overlap.most_of_proposal
    matched = scope.to_classify & pairs
    label = np.zeros(len(size), np.int64)
    label[best[matched]] = truth.object_class[matched]
    range_m = np.bincount(of, np.hypot(points[:, 0], points[:, 1]), len(size)) / np.maximum(size, 1)
    judged = most(_in_sector(points, rules)) & (range_m <= rules.max_range_m)
    range_m[best[matched]] = scope.range_m[matched]
    holder = np.full(len(size), NONE, np.int64)
    i, k = np.nonzero(overlap.held > 0.5 * size)
    holder[k] = i
    owner = np.append(truth.object_class, 0)[holder]
    role = np.where(owner > 0, np.append(truth.role, 0)[holder], Role.COUNTED)

    # On an object that is not judged for its class; where nothing is known.
    excused = (truth.object_class > 0) & (scope.range_m <= rules.max_range_m) & ~scope.to_classify
    if "few" not in rules.ignored:
        excused &= (overlap.count >= rules.min_points_followed) | (truth.role != Role.COUNTED)
    neutral = role != Role.COUNTED
    neutral[best[excused & overlap.most_of_proposal]] = True
    unknown = np.zeros(len(size), np.bool_)
    if "parked" in rules.ignored and len(truth.parked):
        placed = in_box_frame(points, truth)
        for box in truth.parked:
            unknown |= most(inside(placed, box, PARKED_PAD_M))
    if "dontcare" in rules.ignored and truth.regions is not None:
        unknown |= most(truth.regions.contains(points))
    to_call = judged & ~(unknown & (owner == 0)) & (role != Role.IGNORED)
    return _Judgement(
        range_m=range_m,
        label=label,
        owner=owner,
        to_classify=judged & ~((unknown | neutral) & (label == 0)),
        to_call=to_call,
        to_associate=to_call & ~(neutral & (label == 0)),
    )


def _outcome(overlap: Overlap) -> Int:
    """(n,) `Outcome` of each object."""
    conditions = {
        Outcome.FOUND: overlap.iou > 0.5,
        Outcome.MISSED: overlap.shared.sum(axis=1) <= 0.5 * overlap.count,
        Outcome.SPLIT: 2 * overlap.most < overlap.count,
        Outcome.MERGED: ~overlap.most_of_proposal,
    }
    return np.select(list(conditions.values()), [int(k) for k in conditions], int(Outcome.PARTIAL))


def _most(which: Bool) -> bool:
    """Whether most points are; nothing is said of an object without points."""
    return not len(which) or bool(which.mean() > 0.5)


def _in_sector(points: Float32, rules: Rules) -> Bool:
    """(N,) whether each point lies in the labelled sector."""
    if rules.sector_deg >= 180:
        return np.ones(len(points), np.bool_)
    ahead: Bool = np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.deg2rad(rules.sector_deg)
    return ahead
