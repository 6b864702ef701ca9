"""Proposals and tracks of one frame against its labelled objects, by the points that they share.

Every figure of an evaluation is computed from the two tables that `judge` fills, and from its associations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from modt.evaluation.rules import Rules
from modt.evaluation.truth import FrameTruth, Role
from modt.geometry import FieldOfView, inverse, transform
from modt.types import CLASS_NAMES, N_CLASSES, NONE, Bool, Float32, Float64, FrameResult, Int

PAD_M, FOOT_M, PARKED_PAD_M = 0.15, 0.25, 0.4
"""Points of an object: up to PAD_M beyond its box, and FOOT_M above its foot."""
WHOLE_VIEW = 0.9
"""An object is cut by the view if less of its points lie inside."""
CELL_M, REACH_M = 1.0, 128.0


class Outcome(IntEnum):
    """What segmentation made of an object."""

    FOUND = 0
    MERGED = 1
    """Its proposal holds half of it, and is less than half its own."""
    SPLIT = 2
    """No proposal holds half of it, all together do."""
    PARTIAL = 3
    """Each holds half of the other, their intersection over union is one half or less."""
    MISSED = 4
    """Most of its points are in no proposal."""


@dataclass(frozen=True, slots=True)
class JudgedFrame:
    """What was found in a frame, and what is true of it.

    Attributes:
        index: number of the frame.
        points: (N, 4) sensor frame.
        proposal: (N,) proposal of each point, NONE where it belongs to none.
        n_proposals: in the frame.
        classified: proposals classified in it.
        track: (M,) identity of each track that is seen.
        of_track: (M,) its proposal.
        said: (M,) its class.
        posterior: (M, 4) its posterior.
        truth: labels of the frame.
        fov: the part of space that was looked at.
    """

    index: int
    points: Float32
    proposal: Int
    n_proposals: int
    classified: int
    track: Int
    of_track: Int
    said: Int
    posterior: Float64
    truth: FrameTruth
    fov: FieldOfView = field(default_factory=FieldOfView)

    @classmethod
    def of_result(cls, result: FrameResult, truth: FrameTruth, fov: FieldOfView | None = None) -> Self:
        """A result of the pipeline that is still in memory."""
        tracks, proposals = result.tracks, result.proposals
        seen = np.flatnonzero(tracks.proposal != NONE)
        return cls(
            index=result.frame.index,
            points=result.frame.points,
            proposal=proposals.label(len(result.frame.points)),
            n_proposals=len(proposals),
            classified=result.classified,
            track=tracks.id[seen],
            of_track=tracks.proposal[seen],
            said=tracks.object_class[seen],
            posterior=tracks.posterior[seen],
            truth=truth,
            fov=FieldOfView() if fov is None else fov,
        )


class Rows:
    """A table of columns of one length."""

    @classmethod
    def joined(cls, tables: Sequence[Self]) -> Self:
        """The rows of all."""
        names = [f.name for f in fields(cls)]  # type: ignore[arg-type]
        return cls(*(np.concatenate([getattr(table, name) for table in tables]) for name in names))

    def take(self, which: Bool) -> Self:
        """Some of the rows."""
        return type(self)(*(getattr(self, f.name)[which] for f in fields(self)))  # type: ignore[arg-type]


@dataclass(frozen=True)
class ObjectRows(Rows):
    """Labelled objects, one row an object and frame.

    Attributes:
        drive, frame, id: which one it is.
        type_: labelled type.
        object_class, role: class and `Role`.
        range_m: of the box's centre [m].
        cut: by the view.
        to_segment, to_classify, to_follow: whether it is judged for segmentation, class and life.
        outcome: of segmentation.
        said: class of the proposal that found it, NONE where none did.
        track: that owns its best proposal, NONE where none does.
    """

    drive: Int
    frame: Int
    id: Int
    type_: NDArray[np.object_]
    object_class: Int
    role: Int
    range_m: Float64
    cut: Bool
    to_segment: Bool
    to_classify: Bool
    to_follow: Bool
    outcome: Int
    said: Int
    track: Int


@dataclass(frozen=True)
class ProposalRows(Rows):
    """Proposals that a track owns, one row a proposal and frame.

    Attributes:
        drive, frame, track: whose it is.
        range_m: mean of its points' [m].
        posterior: (R, 4) what is said of it.
        said: class that the program says.
        label: class of the object that it stands for, BACKGROUND for none.
        owner: class of the object whose box holds most of its points, BACKGROUND for none.
        to_classify, to_call: whether it is judged for average precision and for the class that is said.
    """

    drive: Int
    frame: Int
    track: Int
    range_m: Float64
    posterior: Float64
    said: Int
    label: Int
    owner: Int
    to_classify: Bool
    to_call: Bool


@dataclass(frozen=True, slots=True)
class Association:
    """Objects and tracks of one class in a frame.

    Attributes:
        truth: (n,) identities of objects.
        track: (k,) identities of tracks.
        similarity: (n, k) of each pair, 0 to 1.
    """

    truth: Int
    track: Int
    similarity: Float64


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of a frame: rows of both tables, and by class what was to be associated."""

    objects: ObjectRows
    proposals: ProposalRows
    associations: tuple[Association, ...]


def judge(frame: JudgedFrame, rules: Rules, drive: int = 0) -> Judged:
    """Compare a frame with its truth; what is compared and what ignored: docs/evaluation.md."""
    truth, ignored = frame.truth, rules.ignored
    n, n_proposals = len(truth.id), max(frame.n_proposals, int(frame.proposal.max(initial=NONE)) + 1)
    size = np.bincount(frame.proposal + 1, minlength=n_proposals + 1)[1:]
    own, whole = _points_of(frame.points, truth)
    shared, held = (_overlap(points, frame.proposal, n_proposals) for points in (own, whole))
    count = np.array([len(points) for points in own], np.int64)
    best = shared.argmax(axis=1) if n_proposals else np.zeros(n, np.int64)
    most = shared.max(axis=1, initial=0)
    best_size = size[best] if n_proposals else np.zeros(n, np.int64)
    iou = most / np.maximum(best_size + count - most, 1)
    most_of_object, most_of_proposal = most > 0.5 * count, most > 0.5 * best_size
    outcome = np.select(
        [iou > 0.5, shared.sum(axis=1) <= 0.5 * count, 2 * most < count, ~most_of_proposal],
        [Outcome.FOUND, Outcome.MISSED, Outcome.SPLIT, Outcome.MERGED],
        Outcome.PARTIAL,
    )

    foreground = (truth.object_class > 0) & (truth.role != Role.IGNORED)
    range_m = np.hypot(*(truth.box[:, :2] - truth.T_box_sensor[:2, 3]).T)
    near = range_m <= rules.max_range_m
    in_view = np.array([frame.fov.contains(frame.points[points]).mean() if len(points) else 1.0 for points in own])
    cut = in_view < WHOLE_VIEW
    kept = near & ~(cut if "cut" in ignored else np.zeros_like(cut))
    enough = count >= rules.min_points_followed
    positive = kept & enough & foreground & (truth.role == Role.COUNTED)

    # Of each proposal: the track that owns it, the object that it stands for, the object in whose box it lies.
    row_of = np.full(n_proposals, NONE, np.int64)
    row_of[frame.of_track] = np.arange(len(frame.track))
    matched = positive & (iou > 0.5 if rules.by_iou else most_of_object & most_of_proposal)
    label = np.zeros(n_proposals, np.int64)
    label[best[matched]] = truth.object_class[matched]
    owner = np.full(n_proposals, NONE, np.int64)
    i, k = np.nonzero(held > 0.5 * size)
    owner[k] = i
    owner_class, owner_role = (
        np.append(column, 0)[owner] for column in (truth.object_class, np.where(truth.object_class > 0, truth.role, 0))
    )
    excused = (truth.object_class > 0) & near & ~positive & most_of_proposal & (most > 0)
    if "few" not in ignored:
        excused &= enough | (truth.role != Role.COUNTED)
    neutral = owner_role != Role.COUNTED
    neutral[best[excused]] = True

    # Whether a proposal is judged at all.
    members = np.flatnonzero(frame.proposal >= 0)
    of, points = frame.proposal[members], frame.points[members]
    ahead = np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.deg2rad(rules.sector_deg)
    distance = np.bincount(of, np.hypot(points[:, 0], points[:, 1]), n_proposals) / np.maximum(size, 1)
    judged = (np.bincount(of, ahead, n_proposals) > 0.5 * size) & (distance <= rules.max_range_m)
    unknown = np.zeros(n_proposals, np.bool_)
    if "parked" in ignored and len(truth.parked):
        for box in truth.parked:
            hidden = inside(_in_box_frame(points, truth), box, PARKED_PAD_M)
            unknown |= np.bincount(of[hidden], minlength=n_proposals) > 0.5 * size
    if "dontcare" in ignored and truth.regions is not None:
        unknown |= np.bincount(of[truth.regions.contains(points)], minlength=n_proposals) > 0.5 * size

    track, said = np.append(frame.track, NONE)[row_of], np.append(frame.said, NONE)[row_of]
    tracked = row_of != NONE
    to_call = judged & tracked & ~(unknown & (owner_class == 0)) & (owner_role != Role.IGNORED)
    to_classify = judged & tracked & ~((unknown | neutral) & (label == 0))
    best_said = said[best] if n_proposals else np.full(n, NONE)
    best_track = np.where(most > 0, track[best], NONE) if n_proposals else np.full(n, NONE)
    objects = ObjectRows(
        drive=np.full(n, drive),
        frame=np.full(n, frame.index),
        id=truth.id,
        type_=np.array(truth.type_, np.object_),
        object_class=truth.object_class,
        role=truth.role,
        range_m=range_m,
        cut=cut & near & (count >= rules.min_points) & (truth.role != Role.IGNORED),
        to_segment=kept & (count >= rules.min_points) & (truth.role != Role.IGNORED),
        to_classify=positive,
        to_follow=kept & enough & foreground,
        outcome=outcome,
        said=np.where(outcome == Outcome.FOUND, best_said, NONE),
        track=best_track,
    )
    posterior = np.zeros((n_proposals, N_CLASSES))
    posterior[frame.of_track] = frame.posterior
    columns = (np.full(n_proposals, drive), np.full(n_proposals, frame.index), track, distance, posterior, said)
    rows = ProposalRows(*columns, label, owner_class, to_classify, to_call).take(tracked)
    union = size + count[:, None] - shared
    associations = tuple(
        _association(truth.id, track, shared / np.maximum(union, 1), positive & (truth.object_class == c), ours)
        for c in range(1, len(CLASS_NAMES))
        for ours in [to_call & (said == c) & ~(neutral & (label == 0))]
    )
    return Judged(objects, rows, associations)


def _association(id_: Int, track: Int, similarity: Float64, objects: Bool, proposals: Bool) -> Association:
    return Association(id_[objects], track[proposals], similarity[objects][:, proposals])


def inside(points: NDArray[Any], box: Float64, pad_m: float = PAD_M, foot_m: float = FOOT_M) -> Bool:
    """(N,) whether each of (N, 3 or more) points lies in a (7,) box grown by pad_m, foot_m above its foot."""
    c, s = float(np.cos(box[6])), float(np.sin(box[6]))
    x, y, z = (points[:, k] - float(box[k]) for k in range(3))
    length, width, height = (box[3:6] / 2).tolist()
    within: Bool = (
        (np.abs(c * x + s * y) < length + pad_m)
        & (np.abs(c * y - s * x) < width + pad_m)
        & (z > foot_m - height)
        & (z < height + pad_m)
    )
    return within


def _points_of(points: Float32, truth: FrameTruth) -> tuple[list[Int], list[Int]]:
    """Points of each object, clear of the ground; and all in its box."""
    if not len(truth.id):
        return [], []
    centre = transform(inverse(truth.T_box_sensor), truth.box[:, :3])
    reach = np.hypot(truth.box[:, 3], truth.box[:, 4]) / 2 + 2 * PAD_M
    near = np.flatnonzero(_beside(points, centre, reach))
    local, moved = points[near], _in_box_frame(points[near], truth)
    own, whole = [], []
    for row, box in enumerate(truth.box):
        x, y = (np.float32(v) for v in centre[row, :2])
        r = np.float32(reach[row] + 0.05 * box[5])  # sensors are tilted by a few degrees at most
        k = np.flatnonzero((np.abs(local[:, 0] - x) < r) & (np.abs(local[:, 1] - y) < r))
        k = k[inside(moved[k], box, foot_m=-PAD_M)]
        clear = moved[k, 2] > float(box[2] - box[5] / 2) + FOOT_M
        whole.append(near[k])
        own.append(near[k[clear]])
    return own, whole


def _beside(points: Float32, centre: Float64, reach: Float64) -> Bool:
    """(N,) whether each point lies in a cell of the ground plane that a circle touches; a few more than needed."""
    n = int(2 * REACH_M / CELL_M)
    table = np.zeros((n, n), np.bool_)
    low = np.clip(((centre[:, :2] - reach[:, None] + REACH_M) / CELL_M).astype(np.int64) - 1, 0, n - 1)
    high = np.clip(((centre[:, :2] + reach[:, None] + REACH_M) / CELL_M).astype(np.int64) + 1, 0, n - 1)
    for (a, b), (c, d) in zip(low.tolist(), high.tolist(), strict=True):
        table[a : c + 1, b : d + 1] = True
    cell = ((points[:, :2] + np.float32(REACH_M)) * np.float32(1 / CELL_M)).astype(np.int32)
    np.clip(cell, 0, n - 1, out=cell)
    beside: Bool = table.ravel()[cell[:, 0] * n + cell[:, 1]]
    return beside


def _in_box_frame(points: Float32, truth: FrameTruth) -> NDArray[Any]:
    """(N, 3 or more) points in the frame in which boxes are upright."""
    T = truth.T_box_sensor
    return points if np.array_equal(T, np.eye(4)) else transform(T, points[:, :3].astype(np.float64))


def _overlap(objects: list[Int], proposal: Int, n_proposals: int) -> Int:
    """(n, P) points that each object shares with each proposal."""
    rows = np.repeat(np.arange(len(objects)), [len(points) for points in objects])
    of = proposal[np.concatenate([np.zeros(0, np.int64), *objects])]
    held = of >= 0
    flat = np.bincount(rows[held] * n_proposals + of[held], minlength=len(objects) * n_proposals)
    return flat.reshape(len(objects), n_proposals).astype(np.int64)
