"""Figures with bootstrap intervals over objects or tracks: the frames of one are not independent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from modt.types import Bool, Float64, Int
from modt_desk.evaluation.rows import Rows

RESAMPLES, SEED, LEVEL = 200, 0, (2.5, 97.5)
_TOGETHER = 8
"""Resamples that are ranked at a time, to stay in the cache."""
RECALLS = np.arange(1, 20) / 20


@dataclass(frozen=True, slots=True)
class Estimate:
    """A figure, its 95 % interval (None where fewer than two things are resampled), and how many these are."""

    value: float | None
    low: float | None = None
    high: float | None = None
    n: int | None = None


def ratio(part: ArrayLike, whole: ArrayLike) -> Estimate:
    """Sum of the parts (n,) of each object over that of their wholes (n,)."""
    a, b = np.asarray(part, np.float64), np.asarray(whole, np.float64)
    n = len(b)
    if not b.sum():
        return Estimate(None, n=n)
    if n < 2:
        return Estimate(float(a.sum() / b.sum()), n=n)
    weight = _weights(n)
    below = weight @ b
    resampled = (weight @ a)[below > 0] / below[below > 0]
    low, high = np.percentile(resampled, LEVEL).tolist()
    return Estimate(float(a.sum() / b.sum()), low, high, n)


@dataclass(frozen=True, slots=True)
class Ranking:
    """Proposals by decreasing score, down to the last right one.

    Attributes:
        hit: (R,) whether each is right.
        unit: (R,) object that each stands for, or the track of a false one, numbered behind the objects.
        wanted: (n,) times that each object is to be found.
        tracks: number of tracks of false ones.
    """

    hit: Bool
    unit: Int
    wanted: Float64
    tracks: int

    @classmethod
    def of(cls, objects: Rows, proposals: Rows, object_class: int, counted: Bool) -> Ranking:
        """For one class, of the judged proposals; counted: which objects' rows are of it."""
        seen = objects[counted]
        names, of_row = np.unique(seen[["drive", "id"]], return_inverse=True)
        proposals = proposals[proposals["to_classify"]]
        score, hit = proposals["posterior"][:, object_class], proposals["label"] == object_class
        order = np.argsort(-score, kind="stable")
        order = order[: np.flatnonzero(hit[order]).max(initial=-1) + 1]
        proposals, hit = proposals[order], hit[order]
        tracks, of_track = np.unique(proposals[["drive", "track"]], return_inverse=True)
        unit = len(names) + of_track
        object_at = dict(zip(seen[["drive", "frame", "track"]].tolist(), of_row.tolist(), strict=True))
        places = proposals[hit][["drive", "frame", "track"]].tolist()
        unit[hit] = [object_at.get(place, u) for place, u in zip(places, unit[hit].tolist(), strict=True)]
        return cls(hit, unit, np.bincount(of_row, minlength=len(names)).astype(np.float64), len(tracks))

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
        envelope = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
        wanted = weight[:, : len(self.wanted)] @ self.wanted
        return envelope, true / np.maximum(wanted, 1e-9)[:, None]


def _areas(precision: Float64, recall: Float64) -> Float64:
    areas: Float64 = (np.diff(recall, prepend=0.0, axis=1) * precision).sum(axis=1)
    return areas


def _weights(n: int) -> Float64:
    """(RESAMPLES, n) times that each of n is drawn; the same for the same n."""
    random, weight = np.random.default_rng([SEED, n]), np.empty((RESAMPLES, n))
    for times in weight:
        times[:] = np.bincount(random.integers(n, size=n), minlength=n)
    return weight
