"""Rows grouped by label, and reductions over all groups at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from modt.types import NONE, Bool, Float32, Int

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Groups:
    """Rows sorted by group; no group is empty."""

    rows: Int  # (K,) sorted by group, in input order within a group
    offsets: Int  # (G + 1,) group i owns rows[offsets[i]:offsets[i + 1]]

    @classmethod
    def from_labels(cls, labels: Int, n: int) -> Self:
        """Groups 0 to n - 1; rows labelled NONE are left out."""
        rows = np.flatnonzero(labels != NONE)
        # NumPy sorts 16-bit integers by radix: several times faster.
        kind: type[np.signedinteger[Any]] = np.int16 if n < np.iinfo(np.int16).max else np.int64
        own = labels.astype(kind)[rows]
        rows = rows[np.argsort(own, kind="stable")]
        return cls(rows, np.append(0, np.cumsum(np.bincount(own, minlength=n))))

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
