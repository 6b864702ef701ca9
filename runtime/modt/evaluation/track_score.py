"""How long objects are followed: life and its breaks, and the field's metrics as TrackEval computes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.evaluation.rows import Association, ObjectRows, ProposalRows
from modt.types import CLASS_NAMES, NONE, Bool, Float64, Int

SIMILARITY_THRESHOLD = 0.25
"""Similarity from which CLEAR and Identity count a match."""
STAY = 3
"""Frames on an object that make a track its own, for mis-associations."""


@dataclass(frozen=True, slots=True)
class Life:
    """Mean frames that a track follows an object (N_go), of those ideal.

    Attributes:
        objects: that are there to be followed.
        frames: in which they are.
        life: frames followed over objects and discontinuities.
        ideal: frames over objects.
        ratio: of the two.
    """

    objects: int
    frames: int
    life: float | None
    ideal: float | None
    ratio: float | None

    @classmethod
    def of(cls, objects: int, frames: int, followed: int, discontinuities: int) -> Life:
        """From counts."""
        if not objects:
            return cls(0, 0, None, None, None)
        life, ideal = followed / (objects + discontinuities), frames / objects
        return cls(objects, frames, life, ideal, life / ideal if frames else None)


@dataclass(frozen=True, slots=True)
class TrackScore:
    """Objects of one kind over all frames.

    Attributes:
        life: misses count as misses.
        life_as_seen: over the objects and frames that are followed.
        ideal_labelled: labelled frames over labelled objects, whatever points they have.
        followed: share of the frames in which an object is followed.
        discontinuities: times that another track than before follows an object.
        taken_over: of these, by a track that was there before.
        returned: of these, by one that had followed the object before.
        mis_associations: tracks that follow more than one object for STAY frames or more.
    """

    life: Life
    life_as_seen: Life
    ideal_labelled: float
    followed: float | None
    discontinuities: int
    taken_over: int
    returned: int
    mis_associations: int


def track_scores(objects: ObjectRows, proposals: ProposalRows) -> dict[str, TrackScore]:
    """Of all objects that should be followed, by class and by labelled type; nothing where none has an identity."""
    rows = objects.take((objects.object_class > 0) & (objects.role != 2) & (objects.id != NONE))
    groups: dict[str, Bool] = {"all": np.ones(len(rows.id), np.bool_)}
    groups |= {name: (rows.object_class == c) & (rows.role == 0) for c, name in enumerate(CLASS_NAMES) if c}
    groups |= {name: rows.type_ == name for name in sorted(set(rows.type_.tolist()))}
    first = _first_seen(proposals)
    return {name: _score(rows.take(which), first) for name, which in groups.items() if which.any()}


def _first_seen(proposals: ProposalRows) -> dict[tuple[int, int], int]:
    """First frame of every track, by drive and identity."""
    order = np.argsort(proposals.frame, kind="stable")[::-1]
    columns = (column[order].tolist() for column in (proposals.drive, proposals.track, proposals.frame))
    return {(drive, track): frame for drive, track, frame in zip(*columns, strict=True)}


def _score(labelled: ObjectRows, first_seen: dict[tuple[int, int], int]) -> TrackScore:
    rows = labelled.take(labelled.to_follow)
    objects, key = _keys(rows)
    seen = rows.track != NONE
    histories: dict[int, list[tuple[int, int, int]]] = {}
    columns = (column[seen].tolist() for column in (key, rows.drive, rows.frame, rows.track))
    for k, drive, frame, track in zip(*columns, strict=True):
        histories.setdefault(k, []).append((frame, drive, track))
    breaks = taken = returned = 0
    for history in histories.values():
        history.sort()
        past = set()
        for (_, _, before), (frame, drive, track) in pairwise(history):
            past.add(before)
            if track != before:
                breaks += 1
                returned += track in past
                taken += track not in past and first_seen[drive, track] < frame
    followed = int(seen.sum())
    pairs = np.stack([rows.drive[seen], rows.track[seen], key[seen]])
    owned, times = np.unique(pairs, axis=1, return_counts=True)
    owners, held = np.unique(owned[:2, times >= STAY], axis=1, return_counts=True)
    del owners
    return TrackScore(
        life=Life.of(objects, len(rows.id), followed, breaks),
        life_as_seen=Life.of(len(histories), followed, followed, breaks),
        ideal_labelled=len(labelled.id) / _keys(labelled)[0],
        followed=followed / len(rows.id) if len(rows.id) else None,
        discontinuities=breaks,
        taken_over=taken,
        returned=returned,
        mis_associations=int((held > 1).sum()),
    )


def _keys(rows: ObjectRows) -> tuple[int, Int]:
    """How many objects there are, and the number of each row's."""
    unique, key = np.unique(np.stack([rows.drive, rows.id]), axis=1, return_inverse=True)
    return unique.shape[1], key.reshape(-1)


Similarity = Callable[[Float64, Float64], Float64]
"""Of boxes (n, 7) and (n, 7), row by row, 0 to 1: tracking.overlap.iou_3d or birds_eye_iou."""


def box_association(truth: Int, boxes: Float64, track: Int, found: Float64, similarity: Similarity) -> Association:
    """Objects and tracks compared by their boxes (n, 7) and (k, 7)."""
    i, j = np.divmod(np.arange(len(boxes) * len(found)), max(len(found), 1))
    return Association(truth, track, similarity(boxes[i], found[j]).reshape(len(boxes), len(found)))


def track_metrics(sequences: Sequence[Sequence[Association]]) -> dict[str, float]:
    """HOTA, DetA, AssA, MOTA, IDF1 [0 to 1], id switches and fragmentations over all sequences, frame by frame.

    Raises:
        MisuseError: trackeval is not installed.
    """
    try:
        from trackeval.metrics import CLEAR, HOTA, Identity
    except ImportError:
        raise MisuseError("trackeval", "is not installed", "pip install 'modt[evaluate]'") from None
    options = {"THRESHOLD": SIMILARITY_THRESHOLD, "PRINT_CONFIG": False}
    data = [d for d in map(_trackeval_data, sequences) if d["num_gt_dets"]]
    if not data:
        return {}
    found: dict[str, Any] = {}
    for metric in (HOTA(), CLEAR(options), Identity(options)):
        parts = {str(i): metric.eval_sequence(d) for i, d in enumerate(data)}
        found.update(metric.combine_sequences(parts))
    shares = {name: float(np.mean(found[name])) for name in ("HOTA", "DetA", "AssA", "MOTA", "IDF1")}
    return shares | {"id_switches": float(found["IDSW"]), "fragmentations": float(found["Frag"])}


def _trackeval_data(frames: Sequence[Association]) -> dict[str, Any]:
    n_truth, truth = _renumbered([frame.truth for frame in frames])
    n_tracks, tracks = _renumbered([frame.track for frame in frames])
    return {
        "gt_ids": truth,
        "tracker_ids": tracks,
        "similarity_scores": [frame.similarity for frame in frames],
        "num_gt_dets": sum(map(len, truth)),
        "num_tracker_dets": sum(map(len, tracks)),
        "num_gt_ids": n_truth,
        "num_tracker_ids": n_tracks,
        "num_timesteps": len(frames),
    }


def _renumbered(ids: Sequence[Int]) -> tuple[int, list[Int]]:
    """How many identities there are, and those of each frame without gaps."""
    names, number = np.unique(np.concatenate([np.zeros(0, np.int64), *ids]), return_inverse=True)
    return len(names), np.split(number, np.cumsum([len(own) for own in ids])[:-1])
