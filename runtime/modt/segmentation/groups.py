"""Rows grouped by label, and what is computed of all groups at once: extremes, headings of boxes, reflectance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from modt.types import NONE, Bool, Float32, Float64, Int, Self

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True)
class Groups:
    """Rows sorted by group; no group is empty."""

    rows: Int  # (K,) sorted by group, in input order within a group
    offsets: Int  # (G + 1,) group i has rows[offsets[i]:offsets[i + 1]]

    @classmethod
    def from_labels(cls, labels: Int, n: int) -> Self:
        """Groups 0 to n - 1; rows labelled NONE are left out."""
        rows = np.flatnonzero(labels != NONE)
        # NumPy sorts 16-bit integers by radix: several times faster.
        kind: type[np.signedinteger[Any]] = np.int16 if n < np.iinfo(np.int16).max else np.int64
        label_of_row = labels.astype(kind)[rows]
        rows = rows[np.argsort(label_of_row, kind="stable")]
        return cls(rows, np.append(0, np.cumsum(np.bincount(label_of_row, minlength=n))))

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def count(self) -> Int:
        """(G,) rows of each group."""
        return np.diff(self.offsets)

    def subsample(self, limit: int) -> Self:
        """Subsample each group to at most `limit` rows at a constant stride."""
        stride = -(-self.count // limit)
        rank = np.arange(len(self.rows)) - np.repeat(self.offsets[:-1], self.count)
        kept = rank % np.repeat(stride, self.count) == 0
        return type(self)(self.rows[kept], np.append(0, np.cumsum(-(-self.count // stride))))

    def broadcast(self, values: NDArray[T]) -> NDArray[T]:
        """(..., K) value of each row's group, given (..., G)."""
        return np.repeat(values, self.count, axis=-1)

    def min(self, values: NDArray[T]) -> NDArray[T]:
        """(..., G) minimum of each group, given (..., K) in the order of rows."""
        least: NDArray[T] = np.minimum.reduceat(values, self.offsets[:-1], axis=-1)
        return least

    def max(self, values: NDArray[T]) -> NDArray[T]:
        """(..., G) maximum of each group, given (..., K) in the order of rows."""
        most: NDArray[T] = np.maximum.reduceat(values, self.offsets[:-1], axis=-1)
        return most


def consecutive(mask: Bool) -> Int:
    """(n,) rank of each True entry among them, NONE for False."""
    return np.where(mask, mask.cumsum() - 1, NONE)


def label_min(values: Float32, labels: Int, n: int) -> Float32:
    """(n,) minimum of the values of each label, infinite without any."""
    least = np.full(n, np.inf, np.float32)
    np.minimum.at(least, labels, values)
    return least


def label_max(values: Float32, labels: Int, n: int) -> Float32:
    """(n,) maximum of the values of each label, minus infinity without any."""
    most = np.full(n, -np.inf, np.float32)
    np.maximum.at(most, labels, values)
    return most


HEADINGS = np.deg2rad(np.arange(0, 90, 5.0))
"""(H,) candidates for the heading of a box [rad]; the compiled pass has room for 32."""
_SIDES = np.append(HEADINGS, HEADINGS + np.pi / 2)
AXES: Float32 = np.stack([np.cos(_SIDES), np.sin(_SIDES)]).astype(np.float32)
"""(2, 2 H) cosines and sines of the headings, then of what lies across them."""


def best_headings(x: Float32, y: Float32, groups: Groups, limit: int, noise_m: float) -> Int:
    """(G,) index of the heading of the rectangle whose sides the points of a group are closest to.

    Closeness, the sum of 1 / distance to the nearest side, finds the legs of the L that a car shows; the least area
    does not.

    Args:
        x: (K,) points [m].
        y: (K,) points [m].
        groups: groups of the points.
        limit: points of a group that are used, at a constant stride.
        noise_m: distance within which a point lies on a side [m].
    """
    groups = groups.subsample(limit)
    # (2 H, K) coordinate of each point along each axis, then its distance to the nearer of the two sides across it.
    along = AXES[0][:, None] * x.take(groups.rows)
    along += AXES[1][:, None] * y.take(groups.rows)
    inward = along - groups.broadcast(groups.min(along))
    np.minimum(inward, groups.broadcast(groups.max(along)) - along, out=inward)
    nearest = np.minimum(inward[: len(HEADINGS)], inward[len(HEADINGS) :])
    closeness = 1 / np.maximum(nearest, np.float32(noise_m))
    best: Int = np.argmax(np.add.reduceat(closeness, groups.offsets[:-1], axis=1, dtype=np.float64), axis=0)
    return best


BRIGHT = 0.8
"""Exceeded by number plates, lamps and signs only. Models are trained with this value and the next."""
DARK = 0.005
"""Below it a return is too weak to be measured."""
SAMPLE = 1000
"""Number of returns, about, by which a sweep is checked for reflectance."""


def has_reflectance(reflectance: Float32) -> bool:
    """Whether a sweep's (N,) reflectances differ; equal values mean that the recording has none."""
    sample = reflectance[:: max(1, len(reflectance) // SAMPLE)]
    sample = sample[sample >= 0.0]
    return len(sample) > 0 and bool(sample.min() != sample.max())


def reflectance_statistics(points: Float32, index: Int, offsets: Int) -> Float64:
    """(G, 5) mean, standard deviation, maximum, share of bright and share of dark returns of each group.

    Group i has the (N, 4) points index[offsets[i]:offsets[i + 1]]. Returns without a measurement are ignored; a group
    without any is NaN.
    """
    reflectance = points[index, 3]
    starts = offsets[:-1]
    is_measured = reflectance >= 0.0
    value = np.where(is_measured, reflectance, np.float32(0.0))
    n_measured, n_bright, n_dark = (
        np.add.reduceat(mask.astype(np.float32), starts)
        for mask in (is_measured, value > BRIGHT, is_measured & (value < DARK))
    )
    count = np.where(n_measured > 0, n_measured.astype(np.float64), np.nan)
    mean, mean_square = (np.add.reduceat(v, starts, dtype=np.float64) / count for v in (value, value * value))
    deviation = np.sqrt(np.maximum(mean_square - mean * mean, 0.0))
    greatest = np.maximum.reduceat(np.where(is_measured, reflectance, np.float32(-np.inf)), starts)
    maximum = np.where(n_measured > 0, greatest, np.nan)
    return np.stack([mean, deviation, maximum, n_bright / count, n_dark / count], axis=1)
