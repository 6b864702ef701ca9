"""Lengths and breaks of tracks; HOTA, CLEAR and Identity as TrackEval computes them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from modt.types import NONE, Int
from modt_evaluation.rows import Association, Rows, kinds, ratio
from modt_evaluation.truth import LABELLED

SIMILARITY_THRESHOLD = 0.25
"""Similarity from which CLEAR and Identity count a match."""
MIN_FRAMES_FOLLOWED = 3
"""A track that follows each of several objects for this many frames or more is a mis-association."""


@dataclass(frozen=True)
class Length:
    """Mean number of frames for which a track follows a labelled object, beside that of faultless tracking."""

    objects: int  # objects counted
    frames: int  # frames counted, summed over the objects
    life: float | None  # the length: frames followed / (objects + discontinuities)
    ideal: float | None  # frames / objects
    ratio: float | None  # life / ideal


def _length(objects: int, frames: int, followed: int, discontinuities: int) -> Length:
    length = ratio(followed, objects + discontinuities)
    ideal = ratio(frames, objects)
    return Length(objects, frames, length, ideal, ratio(length or 0.0, ideal or 0.0))


@dataclass(frozen=True)
class TrackScore:
    """Scores of the tracks of one kind of objects over all frames.

    At a discontinuity, another track follows the object than when it was last followed. If that track had followed it
    earlier, this counts as returned; if not, but the track existed before, as taken over; if it is new, as neither.
    """

    life: Length  # over the frames in which the object has points enough to be followed, whether it is or not
    life_as_seen: Length  # over the objects and frames that are followed
    labelled: Length  # over all labelled frames, whatever points the object has there; Table III gives this ideal
    followed: float | None  # share of the frames in which an object is followed
    discontinuities: int  # times that another track than before follows an object
    taken_over: int  # number of these by a track that existed before and had not followed the object
    returned: int  # number of these by a track that had followed the object before
    mis_associations: int  # tracks that follow more than one object for MIN_FRAMES_FOLLOWED frames or more each


def track_scores(objects: Rows, proposals: Rows) -> dict[str, TrackScore]:
    """Scores of all objects, of each class and of each labelled type; empty where no object has an identity."""
    rows = objects[(objects["class"] > 0) & np.isin(objects["role"], LABELLED) & (objects["id"] != NONE)]
    first: dict[tuple[int, int], int] = {}
    for drive, track, frame in proposals[["drive", "track", "frame"]].tolist():
        first[drive, track] = min(frame, first.get((drive, track), frame))
    groups = {"all": np.ones(len(rows), np.bool_)} | kinds(rows)
    return {name: _score(rows[which], first) for name, which in groups.items() if which.any()}


def _score(all_rows: Rows, first_seen: dict[tuple[int, int], int]) -> TrackScore:
    rows = all_rows[all_rows["to_follow"]]
    seen = rows[rows["track"] != NONE]
    histories: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for drive, id_, frame, track in seen[["drive", "id", "frame", "track"]].tolist():
        histories.setdefault((drive, id_), []).append((frame, track))
    breaks = 0
    taken = 0
    returned = 0
    for (drive, _), history in histories.items():
        past = set()
        for (_, before), (frame, track) in pairwise(sorted(history)):
            past.add(before)
            breaks += track != before
            returned += track != before and track in past
            taken += track not in past and first_seen[drive, track] < frame
    frames_of = Counter(seen[["drive", "track", "id"]].tolist())
    objects_of = Counter((drive, track) for (drive, track, _), n in frames_of.items() if n >= MIN_FRAMES_FOLLOWED)
    return TrackScore(
        life=_length(_count(rows), len(rows), len(seen), breaks),
        life_as_seen=_length(len(histories), len(seen), len(seen), breaks),
        labelled=_length(_count(all_rows), len(all_rows), len(seen), breaks),
        followed=ratio(len(seen), len(rows)),
        discontinuities=breaks,
        taken_over=taken,
        returned=returned,
        mis_associations=sum(n > 1 for n in objects_of.values()),
    )


def _count(rows: Rows) -> int:
    """Number of objects in the rows."""
    return len(set(rows[["drive", "id"]].tolist()))


def track_metrics(sequences: Sequence[Sequence[Association]]) -> dict[str, float]:
    """HOTA, DetA, AssA, MOTA, IDF1 [0 to 1], id switches and fragmentations over all sequences; needs trackeval."""
    from trackeval.metrics import CLEAR, HOTA, Identity

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
    """Number of identities, and the identities of each frame renumbered without gaps."""
    names, number = np.unique(np.concatenate([np.zeros(0, np.int64), *ids]), return_inverse=True)
    return len(names), np.split(number, np.cumsum(list(map(len, ids)))[:-1])
