"""How long objects are followed: life and its breaks, and the field's metrics as TrackEval computes them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.evaluation.rows import Association, Rows, kinds
from modt.evaluation.truth import Role
from modt.types import NONE, Int

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
        labelled: objects and frames that are labelled, whatever points they have; its ideal is that of Table III.
        followed: share of the frames in which an object is followed.
        discontinuities: times that another track than before follows an object.
        taken_over: of these, by a track that was there before.
        returned: of these, by one that had followed the object before.
        mis_associations: tracks that follow more than one object for STAY frames or more.
    """

    life: Life
    life_as_seen: Life
    labelled: Life
    followed: float | None
    discontinuities: int
    taken_over: int
    returned: int
    mis_associations: int


def track_scores(objects: Rows, proposals: Rows) -> dict[str, TrackScore]:
    """Of all objects, by class and by labelled type; nothing where none has an identity."""
    rows = objects[(objects["class"] > 0) & (objects["role"] != Role.IGNORED) & (objects["id"] != NONE)]
    first: dict[tuple[int, int], int] = {}
    for drive, track, frame in proposals[["drive", "track", "frame"]].tolist():
        first[drive, track] = min(frame, first.get((drive, track), frame))
    groups = {"all": np.ones(len(rows), np.bool_)} | kinds(rows)
    return {name: _score(rows[which], first) for name, which in groups.items() if which.any()}


def _score(labelled: Rows, first_seen: dict[tuple[int, int], int]) -> TrackScore:
    rows = labelled[labelled["to_follow"]]
    seen = rows[rows["track"] != NONE]
    histories: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for drive, id_, frame, track in seen[["drive", "id", "frame", "track"]].tolist():
        histories.setdefault((drive, id_), []).append((frame, track))
    breaks = taken = returned = 0
    for (drive, _), history in histories.items():
        past = set()
        for (_, before), (frame, track) in pairwise(sorted(history)):
            past.add(before)
            breaks += track != before
            returned += track != before and track in past
            taken += track not in past and first_seen[drive, track] < frame
    frames_of = Counter(seen[["drive", "track", "id"]].tolist())
    owned = Counter((drive, track) for (drive, track, _), n in frames_of.items() if n >= STAY)
    return TrackScore(
        life=Life.of(_count(rows), len(rows), len(seen), breaks),
        life_as_seen=Life.of(len(histories), len(seen), len(seen), breaks),
        labelled=Life.of(_count(labelled), len(labelled), len(seen), breaks),
        followed=len(seen) / len(rows) if len(rows) else None,
        discontinuities=breaks,
        taken_over=taken,
        returned=returned,
        mis_associations=sum(n > 1 for n in owned.values()),
    )


def _count(rows: Rows) -> int:
    """Objects of the rows."""
    return len(set(rows[["drive", "id"]].tolist()))


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
