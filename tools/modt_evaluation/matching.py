"""Proposals and tracks of a frame against its labelled objects, by the points that they share.

docs/evaluation.md states the rules.
"""

from __future__ import annotations

import numpy as np

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.types import NONE, Bool, Float32, Int
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.overlap import ObjectPoints, Overlap, in_box_frame, inside
from modt_evaluation.rows import OBJECT, PROPOSAL, Association, Outcome, Rows, table
from modt_evaluation.rules import Rules
from modt_evaluation.truth import CLASSIFIED, LABELLED, Role

PARKED_PAD_M = 0.4
"""Margin of the box of a parked car [m]. A proposal mostly within it is part of that car."""


def judge(
    frame: JudgedFrame, rules: Rules, drive: int = 0, points: ObjectPoints | None = None
) -> tuple[Rows, Rows, tuple[Association, ...]]:
    """The rows of a frame's objects and of its tracked proposals, and the associations of each class.

    `points` are the points of the labelled objects, where they are known.
    """
    overlap = Overlap.of(frame, points)
    row = np.full(len(overlap.size), NONE, np.int64)
    row[frame.of_track] = np.arange(len(frame.track))
    track, reported = (np.append(column, NONE)[row] for column in (frame.track, frame.reported))
    objects = _objects(frame, overlap, rules)
    pairs = overlap.iou > 0.5 if rules.by_iou else overlap.most_of_object & overlap.most_of_proposal
    proposals = _proposals(frame, overlap, objects, pairs, rules)
    objects["drive"] = proposals["drive"] = drive
    objects["frame"] = proposals["frame"] = frame.index
    objects["reported"] = np.where(objects["outcome"] == Outcome.DETECTED, reported[overlap.best], NONE)
    objects["reported_by_match"] = np.where(pairs, reported[overlap.best], NONE)
    objects["track"] = np.where(overlap.most > 0, track[overlap.best], NONE)
    proposals["track"], proposals["reported"] = track, reported
    proposals["posterior"] = np.append(frame.posterior, np.zeros((1, N_CLASSES)), axis=0)[row]
    associations = []
    for c in range(1, len(CLASS_NAMES)):
        i = np.flatnonzero(objects["to_classify"] & objects["to_follow"] & (objects["class"] == c))
        k = np.flatnonzero(proposals["to_associate"] & (reported == c))
        shared = overlap.shared[np.ix_(i, k)]
        union = overlap.count[i, None] + overlap.size[k] - shared
        associations.append(Association(objects["id"][i], track[k], shared / np.maximum(union, 1)))
    return objects, proposals[row != NONE], tuple(associations)


def _objects(frame: JudgedFrame, overlap: Overlap, rules: Rules) -> Rows:
    truth, cut_counts = frame.truth, "cut" not in rules.ignored
    range_m = np.hypot(*(truth.box[:, :2] - truth.T_box_sensor[:2, 3]).T)
    shown = frame.points[np.concatenate([np.zeros(0, np.int64), *overlap.own])]
    of = np.repeat(np.arange(len(overlap.own)), overlap.count)

    def most(which: Bool) -> Bool:
        """(n,) whether most points of each object satisfy it; true for an object without points."""
        times = np.bincount(of[which], minlength=len(overlap.own))
        return np.asarray((times > 0.5 * overlap.count) | (overlap.count == 0))

    in_view, in_sector = most(frame.fov.depth(shown) > 0), most(_in_sector(shown, rules))
    near = range_m <= rules.max_range_m
    wanted = np.isin(truth.role, LABELLED) & near
    of_class = (truth.object_class > 0) & _has_points(frame, overlap, rules)
    whole = cut_counts | (in_view & in_sector)
    return table(
        OBJECT,
        len(truth.id),
        **{"id": truth.id, "type": truth.type_, "class": truth.object_class, "role": truth.role},
        range_m=range_m,
        in_view=in_view,
        to_segment=wanted & (overlap.count >= rules.min_points) & (in_view | cut_counts),
        to_classify=of_class & whole & near & np.isin(truth.role, CLASSIFIED),
        to_follow=of_class & wanted,
        outcome=_outcome(overlap),
    )


def _has_points(frame: JudgedFrame, overlap: Overlap, rules: Rules) -> Bool:
    """(n,) whether each object has the points to be judged for its class."""
    further = frame.truth.role == Role.FURTHER
    return np.asarray(overlap.count >= np.where(further, rules.min_points_further, rules.min_points_followed))


def _outcome(overlap: Overlap) -> Int:
    """(n,) `Outcome` of each object."""
    conditions = {
        Outcome.DETECTED: overlap.iou > 0.5,
        Outcome.MISSED: overlap.shared.sum(axis=1) <= 0.5 * overlap.count,
        Outcome.SPLIT: overlap.most < 0.5 * overlap.count,
        Outcome.MERGED: ~overlap.most_of_proposal,
    }
    return np.select([*conditions.values()], [*map(int, conditions)], int(Outcome.PARTIAL))


def _proposals(frame: JudgedFrame, overlap: Overlap, objects: Rows, pairs: Bool, rules: Rules) -> Rows:
    """The rows of all proposals, by (n,) whether the best proposal of each object stands for it."""
    truth, size, best = frame.truth, overlap.size, overlap.best
    members = np.flatnonzero(frame.proposal >= 0)
    of, points = frame.proposal[members], frame.points[members]

    def most(which: Bool) -> Bool:
        """(P,) whether more than half of each proposal's points satisfy it."""
        return np.asarray(np.bincount(of[which], minlength=len(size)) > 0.5 * size)

    # The object that a proposal stands for, and the one in whose box it lies.
    matched = objects["to_classify"] & pairs
    label, owner = np.zeros((2, len(size)), np.int64)
    label[best[matched]] = truth.object_class[matched]
    range_m = np.bincount(of, np.hypot(points[:, 0], points[:, 1]), len(size)) / np.maximum(size, 1)
    judged = most_in_sector(frame, size, rules) & (range_m <= rules.max_range_m)
    range_m[best[matched]] = objects["range_m"][matched]
    held = overlap.held > 0.5 * size
    role = np.full(len(size), Role.COUNTED, np.int64)
    for i, k in zip(*np.nonzero(held & (truth.object_class > 0)[:, None]), strict=True):
        owner[k], role[k] = truth.object_class[i], truth.role[i]

    # Neutral proposals lie on objects that are not judged for their class, unknown ones where nothing is labelled.
    excused = (truth.object_class > 0) & ~objects["to_classify"] & (objects["range_m"] <= rules.max_range_m)
    if "few" not in rules.ignored:
        excused &= _has_points(frame, overlap, rules) | ~np.isin(truth.role, CLASSIFIED)
    neutral, further = ~np.isin(role, CLASSIFIED), role == Role.FURTHER
    further[best[matched & (truth.role == Role.FURTHER)]] = True
    neutral[best[excused & overlap.most_of_proposal]] = True
    unknown = np.zeros(len(size), np.bool_)
    if "parked" in rules.ignored:
        placed = in_box_frame(points, truth) if len(truth.parked) else points
        for box in truth.parked:
            unknown |= most(inside(placed, box, PARKED_PAD_M))
    if "dontcare" in rules.ignored and truth.regions is not None:
        unknown |= most(truth.regions.contains(points))
    to_report = judged & ~(unknown & (owner == 0)) & (role != Role.IGNORED)
    no_object = label == 0
    return table(
        PROPOSAL,
        len(size),
        range_m=range_m,
        label=label,
        owner=owner,
        to_classify=judged & ~((unknown | neutral) & no_object),
        to_report=to_report,
        to_associate=to_report & ~(neutral & no_object) & ~further,
    )


def most_in_sector(frame: JudgedFrame, size: Int, rules: Rules) -> Bool:
    """(P,) whether more than half of the points of each proposal, (P,) in number, lie in the labelled sector."""
    members = frame.proposal >= 0
    inside_sector = frame.proposal[members][_in_sector(frame.points[members], rules)]
    return np.asarray(np.bincount(inside_sector, minlength=len(size)) > 0.5 * size)


def _in_sector(points: Float32, rules: Rules) -> Bool:
    """(N,) whether each point lies in the labelled sector."""
    if rules.sector_deg >= 180:
        return np.ones(len(points), np.bool_)
    return np.less(np.abs(np.arctan2(points[:, 1], points[:, 0])), np.deg2rad(rules.sector_deg))
