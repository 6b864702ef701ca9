"""Figures that several experiments report, with bootstrap intervals over objects or tracks.

The frames of one object are not independent: whole objects and tracks are resampled.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from modt.classes import CLASS_NAMES
from modt.types import NONE, Bool, Float64, Int
from modt_evaluation.class_score import envelope
from modt_evaluation.experiments.judged import Judged
from modt_evaluation.rows import Rows
from modt_evaluation.track_score import track_scores
from modt_evaluation.truth import CLASSIFIED, Role

RESAMPLES = 200
"""Number of resamples of an interval."""
SEED = 0
LEVEL = (2.5, 97.5)
"""Percentiles of the resamples that bound an interval."""
_TOGETHER = 8
"""Number of resamples ranked at a time, so that they stay in the cache."""
RECALLS = np.arange(1, 20) / 20
"""Recalls at which a curve is given."""


@dataclass(frozen=True)
class Estimate:
    """A figure, its 95 % interval (None where fewer than two things are resampled), and how many these are."""

    value: float | None
    low: float | None = None
    high: float | None = None
    n: int | None = None


def ratio(part: ArrayLike, whole: ArrayLike) -> Estimate:
    """Sum of the parts (n,) of each object over that of their wholes (n,)."""
    a = np.asarray(part, np.float64)
    b = np.asarray(whole, np.float64)
    n = len(b)
    if not b.sum():
        return Estimate(None, n=n)
    value = float(a.sum() / b.sum())
    if n < 2:
        return Estimate(value, n=n)
    weight = _weights(n)
    below = weight @ b
    resampled = (weight @ a)[below > 0] / below[below > 0]
    low, high = np.percentile(resampled, LEVEL).tolist()
    return Estimate(value, low, high, n)


@dataclass(frozen=True)
class Ranking:
    """Proposals by decreasing score, down to the last correct one.

    Attributes:
        hit: (R,) whether each is correct.
        unit: (R,) object that each stands for, or the track of a false one, numbered behind the objects.
        wanted: (n,) number of frames in which each object is to be detected.
        tracks: number of tracks of false ones.
    """

    hit: Bool
    unit: Int
    wanted: Float64
    tracks: int

    @classmethod
    def of(cls, objects: Rows, proposals: Rows, object_class: int, counted: Bool) -> Ranking:
        """The ranking for one class; `counted` are the rows of its objects."""
        seen = objects[counted]
        names, object_of_row = np.unique(seen[["drive", "id"]], return_inverse=True)
        proposals = proposals[proposals["to_classify"]]
        proposals = proposals[np.argsort(-proposals["posterior"][:, object_class], kind="stable")]
        hit = proposals["label"] == object_class
        end = np.flatnonzero(hit).max(initial=-1) + 1
        proposals = proposals[:end]
        hit = hit[:end]
        tracks, track_of_proposal = np.unique(proposals[["drive", "track"]], return_inverse=True)
        unit = len(names) + track_of_proposal
        # A correct proposal stands for the object that its track follows in that frame.
        place = ["drive", "frame", "track"]
        object_at = dict(zip(seen[place].tolist(), object_of_row.tolist(), strict=True))
        unit[hit] = [
            object_at.get(at, u) for at, u in zip(proposals[hit][place].tolist(), unit[hit].tolist(), strict=True)
        ]
        return cls(hit, unit, np.bincount(object_of_row, minlength=len(names)).astype(np.float64), len(tracks))

    def average_precision(self) -> Estimate:
        """Area under the envelope of precision over recall."""
        n = len(self.wanted)
        if not n:
            return Estimate(None, n=0)
        precision, recall = self._curves(np.ones((1, n + self.tracks)))
        value = float(_areas(precision, recall)[0])
        if n < 2:
            return Estimate(value, n=n)
        weights = self._weights()
        parts = [_areas(*self._curves(weights[k : k + _TOGETHER])) for k in range(0, RESAMPLES, _TOGETHER)]
        low, high = np.percentile(np.concatenate(parts), LEVEL).tolist()
        return Estimate(value, low, high, n)

    def precision_at_recalls(self) -> list[tuple[float, float]]:
        """Each of RECALLS that is reached, with the precision there."""
        if not len(self.wanted):
            return []
        (precision,), (recall,) = self._curves(np.ones((1, len(self.wanted) + self.tracks)))
        at = np.searchsorted(recall, RECALLS - 1e-9)
        reached = at < len(recall)
        return list(zip(RECALLS[reached].tolist(), precision[at[reached]].tolist(), strict=True))

    def _weights(self) -> Float64:
        """(B, units) times that each object, and each track, is drawn."""
        return np.hstack([_weights(len(self.wanted)), _weights(max(self.tracks, 1))[:, : self.tracks]])

    def _curves(self, weight: Float64) -> tuple[Float64, Float64]:
        """(B, R) envelopes of precision, and recall, for weights (B, units)."""
        drawn = weight[:, self.unit]
        true = np.cumsum(drawn * self.hit, axis=1)
        precision = true / np.maximum(np.cumsum(drawn, axis=1), 1e-9)
        wanted = weight[:, : len(self.wanted)] @ self.wanted
        return envelope(precision), true / np.maximum(wanted, 1e-9)[:, None]


def _areas(precision: Float64, recall: Float64) -> Float64:
    return np.asarray((np.diff(recall, prepend=0.0, axis=1) * precision).sum(axis=1))


def _weights(n: int) -> Float64:
    """(RESAMPLES, n) times that each of n is drawn; the same for the same n."""
    random = np.random.default_rng([SEED, n])
    drawn = [np.bincount(random.integers(n, size=n), minlength=n) for _ in range(RESAMPLES)]
    return np.array(drawn, np.float64)


OBJECTS = CLASS_NAMES[1:]


@dataclass(frozen=True)
class Figure:
    """A figure of an experiment.

    Attributes:
        at: value that is swept, None of a single one.
        quantity: its name, with its unit.
        estimate: the figure.
    """

    at: float | None
    quantity: str
    estimate: Estimate


def rankings(judged: Judged) -> Iterator[tuple[str, Ranking]]:
    """The ranking of each class of objects."""
    objects = judged.objects
    for c, name in enumerate(OBJECTS, 1):
        counted = (objects["class"] == c) & np.isin(objects["role"], CLASSIFIED) & objects["to_classify"]
        yield name, Ranking.of(objects, judged.proposals, c, counted)


def precisions(judged: Judged, at: float | None = None) -> Iterator[Figure]:
    """Average precision by class, and their mean."""
    found = [(name, ranking.average_precision()) for name, ranking in rankings(judged)]
    for name, estimate in found:
        yield Figure(at, f"AP {name}", estimate)
    values = [estimate.value for _, estimate in found if estimate.value is not None]
    yield Figure(at, "AP mean", Estimate(float(np.mean(values)) if values else None))


def curves(judged: Judged, at: float | None = None) -> Iterator[Figure]:
    """Precision over recall by class."""
    for name, ranking in rankings(judged):
        for recall, precision in ranking.precision_at_recalls():
            yield Figure(recall, f"precision {name}", Estimate(precision))


@dataclass(frozen=True)
class ObjectLengths:
    """(n,) frames in which each labelled object is to be followed and is followed, and its discontinuities."""

    wanted: Int
    followed: Int
    breaks: Int

    @classmethod
    def of(cls, judged: Judged) -> ObjectLengths:
        """Lengths by the rules of the judgement of runs."""
        rows = judged.objects
        rows = rows[rows["to_follow"] & (rows["class"] > 0) & (rows["role"] != Role.IGNORED) & (rows["id"] != NONE)]
        rows = np.sort(rows, order=["drive", "id", "frame"])
        names, unit = np.unique(rows[["drive", "id"]], return_inverse=True)
        seen = rows["track"] != NONE
        followed = unit[seen]
        changed = np.diff(rows["track"][seen]) != 0
        broken = followed[1:][(np.diff(followed) == 0) & changed]
        return cls(*(np.bincount(which, minlength=len(names)) for which in (unit, followed, broken)))


def track_lengths(judged: Judged, at: float | None) -> Iterator[Figure]:
    """Lengths of the tracks of objects, and the events that end them early."""
    found = ObjectLengths.of(judged)
    if not len(found.wanted):
        return
    scores = track_scores(judged.objects, judged.proposals)["all"]
    once = np.ones(len(found.wanted))
    yield Figure(at, "objects", Estimate(len(found.wanted)))
    yield Figure(at, "frames", Estimate(len(judged.frames)))
    yield Figure(at, "mis-associations", Estimate(scores.mis_associations))
    yield Figure(at, "discontinuities", Estimate(int(found.breaks.sum())))
    yield Figure(at, "N_go of objects", ratio(found.followed, once + found.breaks))
    yield Figure(at, "ideal N_go", ratio(found.wanted, once))


@dataclass(frozen=True)
class TrackWork:
    """(n,) frames with a proposal of each track, whether most are on objects, and its calls of the network."""

    frames: Int
    on_object: Bool
    calls: Int

    @classmethod
    def of(cls, judged: Judged) -> TrackWork:
        """Table of all tracks."""
        rows = judged.proposals
        names, unit = np.unique(rows[["drive", "track"]], return_inverse=True)
        frames = np.bincount(unit, minlength=len(names))
        on_object = 2 * np.bincount(unit[rows["box_class"] > 0], minlength=len(names)) > frames
        calls = Counter(judged.calls[["drive", "track"]].tolist())
        return cls(frames, on_object, np.array([calls[name] for name in names.tolist()], np.int64))


def efficiencies(judged: Judged, at: float | None = None) -> Iterator[Figure]:
    """Beta of all proposals, and of those on objects."""
    tracks = TrackWork.of(judged)
    on_object = tracks.on_object
    yield Figure(at, "beta", ratio(tracks.calls, tracks.frames))
    yield Figure(at, "beta of objects", ratio(tracks.calls[on_object], tracks.frames[on_object]))
