"""Proposals and tracks of a frame against its labelled objects, by the points that they share.

docs/evaluation.md states the rules.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modt.classes import N_CLASSES
from modt.geometry import inverse, transform
from modt.types import NONE, Bool, Float32, Int
from modt_evaluation.boxes import reported_rows
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.overlap import ObjectPoints, Overlap, in_box_frame, inside
from modt_evaluation.rows import OBJECT, PROPOSAL, Association, Outcome, Rows, table
from modt_evaluation.rules import Rules
from modt_evaluation.truth import CLASSIFIED, LABELLED, FrameTruth, Role

PARKED_PAD_M = 0.4
"""Margin of the box of a parked car [m]. A proposal mostly within it is part of that car."""


class JudgedRows(NamedTuple):
    """Tables of a frame's objects, tracked proposals and reported objects, and the associations of each class."""

    objects: Rows
    proposals: Rows
    associations: tuple[Association, ...]
    reported: Rows


def judge(frame: JudgedFrame, rules: Rules, drive: int = 0, points: ObjectPoints | None = None) -> JudgedRows:
    """All rows of a frame; `points` are the points of the labelled objects, where they are known."""
    overlap = Overlap.of(frame, points)
    objects = _objects(frame, overlap, rules)
    # (n,) whether the best proposal of each object stands for it
    has_match = overlap.iou > 0.5 if rules.by_iou else overlap.most_of_object & overlap.most_of_proposal
    proposals = _proposals(frame, overlap, objects, has_match, rules)
    proposals["track"] = NONE
    proposals["reported"] = NONE
    proposals["track"][frame.of_track] = frame.track
    proposals["reported"][frame.of_track] = frame.reported
    proposals["posterior"][frame.of_track] = frame.posterior
    for rows in (objects, proposals):
        rows["drive"] = drive
        rows["frame"] = frame.index
    best = proposals[overlap.best]
    objects["reported"] = np.where(objects["outcome"] == Outcome.DETECTED, best["reported"], NONE)
    objects["reported_by_match"] = np.where(has_match, best["reported"], NONE)
    objects["track"] = np.where(overlap.most > 0, best["track"], NONE)
    objects["reported_by_best"] = np.where(overlap.most_of_proposal & (overlap.most > 0), best["reported"], NONE)
    tracked = np.isin(np.arange(len(proposals)), frame.of_track)
    reported = reported_rows(frame, objects, proposals["to_report"], drive)
    return JudgedRows(objects, proposals[tracked], _associations(overlap, objects, proposals), reported)


def _associations(overlap: Overlap, objects: Rows, proposals: Rows) -> tuple[Association, ...]:
    """The associations of each class, by the rows of all objects and proposals."""
    made = []
    for c in range(1, N_CLASSES):
        i = np.flatnonzero(objects["to_classify"] & objects["to_follow"] & (objects["class"] == c))
        k = np.flatnonzero(proposals["to_associate"] & (proposals["reported"] == c))
        shared = overlap.shared[np.ix_(i, k)]
        union = overlap.count[i, None] + overlap.size[k] - shared
        made.append(Association(objects["id"][i], proposals["track"][k], shared / np.maximum(union, 1)))
    return tuple(made)


def _objects(frame: JudgedFrame, overlap: Overlap, rules: Rules) -> Rows:
    """The rows of all objects; columns that depend on tracks are blank."""
    truth = frame.truth
    range_m = truth.range_m
    object_of_point = np.repeat(np.arange(len(overlap.count)), overlap.count)
    points = frame.points[np.concatenate([np.zeros(0, np.int64), *overlap.clear])]
    empty = overlap.count == 0
    in_view = _most(object_of_point, frame.fov.depth(points) > 0, overlap.count) | empty
    in_sector = _most(object_of_point, _in_sector(points, rules), overlap.count) | empty
    cut_counts = "cut" not in rules.ignored
    near = range_m <= rules.max_range_m
    wanted = np.isin(truth.role, LABELLED) & near
    of_class = (truth.object_class > 0) & _has_points(frame, overlap, rules)
    return table(
        OBJECT,
        len(truth.id),
        **{"id": truth.id, "type": truth.type_, "class": truth.object_class, "role": truth.role},
        range_m=range_m,
        in_view=in_view,
        to_segment=wanted & (overlap.count >= rules.min_points) & (in_view | cut_counts),
        to_classify=of_class & (cut_counts | (in_view & in_sector)) & near & np.isin(truth.role, CLASSIFIED),
        to_follow=of_class & wanted,
        outcome=_outcome(overlap),
        stamp_s=frame.stamp_s,
        position=transform(frame.T_world_sensor @ inverse(truth.T_box_sensor), truth.box[:, :3])[:, :2],
        points=overlap.count,
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


def _proposals(frame: JudgedFrame, overlap: Overlap, objects: Rows, has_match: Bool, rules: Rules) -> Rows:
    """The rows of all proposals, by (n,) whether the best proposal of each object stands for it."""
    truth = frame.truth
    size = overlap.size
    members = np.flatnonzero(frame.proposal >= 0)
    proposal_of_point = frame.proposal[members]
    points = frame.points[members]

    matched = objects["to_classify"] & has_match
    standing_for = overlap.best[matched]
    label = np.zeros(len(size), np.int64)
    label[standing_for] = truth.object_class[matched]
    range_m = np.bincount(proposal_of_point, np.hypot(points[:, 0], points[:, 1]), len(size)) / np.maximum(size, 1)
    judged = most_in_sector(frame, size, rules) & (range_m <= rules.max_range_m)
    range_m[standing_for] = objects["range_m"][matched]

    box_class, role = _in_boxes(truth, overlap)
    further = role == Role.FURTHER
    further[overlap.best[matched & (truth.role == Role.FURTHER)]] = True
    neutral = ~np.isin(role, CLASSIFIED)
    neutral[overlap.best[_excused(frame, overlap, objects, rules) & overlap.most_of_proposal]] = True
    unknown = _unknown(frame, proposal_of_point, points, size, rules)
    to_report = judged & ~(unknown & (box_class == 0)) & (role != Role.IGNORED)
    no_object = label == 0
    return table(
        PROPOSAL,
        len(size),
        range_m=range_m,
        label=label,
        box_class=box_class,
        to_classify=judged & ~((unknown | neutral) & no_object),
        to_report=to_report,
        to_associate=to_report & ~(neutral & no_object) & ~further,
    )


def _in_boxes(truth: FrameTruth, overlap: Overlap) -> tuple[Int, Int]:
    """(P,) class and role of the object in whose box most of each proposal lies, the last one of several."""
    box_class = np.zeros(len(overlap.size), np.int64)
    role = np.full(len(overlap.size), Role.COUNTED, np.int64)
    held = overlap.held > 0.5 * overlap.size
    for i in np.flatnonzero(truth.object_class):
        box_class[held[i]] = truth.object_class[i]
        role[held[i]] = truth.role[i]
    return box_class, role


def _excused(frame: JudgedFrame, overlap: Overlap, objects: Rows, rules: Rules) -> Bool:
    """(n,) objects of a class that are not judged for it: a proposal on one is neutral, neither true nor false."""
    excused = (objects["class"] > 0) & ~objects["to_classify"] & (objects["range_m"] <= rules.max_range_m)
    if "few" not in rules.ignored:
        excused &= _has_points(frame, overlap, rules) | ~np.isin(objects["role"], CLASSIFIED)
    return np.asarray(excused)


def _unknown(frame: JudgedFrame, proposal_of_point: Int, points: Float32, size: Int, rules: Rules) -> Bool:
    """(P,) proposals where nothing is labelled, by the points of all proposals."""
    truth = frame.truth
    unknown = np.zeros(len(size), np.bool_)
    if "parked" in rules.ignored and len(truth.parked):
        placed = in_box_frame(points, truth)
        for box in truth.parked:
            unknown |= _most(proposal_of_point, inside(placed, box, PARKED_PAD_M), size)
    if "dontcare" in rules.ignored and truth.regions is not None:
        unknown |= _most(proposal_of_point, truth.regions.contains(points), size)
    return unknown


def most_in_sector(frame: JudgedFrame, size: Int, rules: Rules) -> Bool:
    """(P,) whether more than half of the points of each proposal, (P,) in number, lie in the labelled sector."""
    members = frame.proposal >= 0
    return _most(frame.proposal[members], _in_sector(frame.points[members], rules), size)


def _most(group: Int, which: Bool, size: Int) -> Bool:
    """(g,) whether more than half of each group's points, (g,) in number, are chosen, by the group of each point."""
    return np.asarray(np.bincount(group[which], minlength=len(size)) > 0.5 * size)


def _in_sector(points: Float32, rules: Rules) -> Bool:
    """(N,) whether each point lies in the labelled sector."""
    if rules.sector_deg >= 180:
        return np.ones(len(points), np.bool_)
    return np.less(np.abs(np.arctan2(points[:, 1], points[:, 0])), np.deg2rad(rules.sector_deg))
