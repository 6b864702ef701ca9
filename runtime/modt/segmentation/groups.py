"""Rows grouped by what they belong to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from modt.types import NONE, Float64, Int

Real = NDArray[np.floating[Any]]
T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Groups:
    """Rows sorted by group, for reductions over all groups at once. No group is empty.

    Attributes:
        rows: (K,) rows in the order of their groups, and in input order within one.
        offsets: (G + 1,) group i owns rows[offsets[i]:offsets[i + 1]].
    """

    rows: Int
    offsets: Int

    @classmethod
    def of(cls, group: Int, n: int) -> Self:
        """Groups 0 to n - 1 of each row; a row of group NONE is left out."""
        rows = np.flatnonzero(group != NONE)
        # 16-bit integers are sorted by radix: several times faster.
        kind: type[np.signedinteger[Any]] = np.int16 if n < np.iinfo(np.int16).max else np.int64
        own = group.astype(kind)[rows]
        rows = rows[np.argsort(own, kind="stable")]
        return cls(rows, np.append(0, np.cumsum(np.bincount(own, minlength=n))))

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def count(self) -> Int:
        """(G,) rows of each group."""
        return np.diff(self.offsets)

    def thinned(self, most: int) -> Self:
        """Every so manieth row of each group, so that none has more than so many."""
        every = -(-self.count // most)
        rank = np.arange(len(self.rows)) - np.repeat(self.offsets[:-1], self.count)
        kept = rank % np.repeat(every, self.count) == 0
        return type(self)(self.rows[kept], np.append(0, np.cumsum(-(-self.count // every))))

    def spread(self, values: NDArray[T]) -> NDArray[T]:
        """(..., K) values (..., G) of the groups given to each of their rows."""
        return np.repeat(values, self.count, axis=-1)

    def least(self, values: NDArray[T]) -> NDArray[T]:
        """(..., G) least of (..., K) values in each group."""
        least: NDArray[T] = np.minimum.reduceat(values, self.offsets[:-1], axis=-1)
        return least

    def most(self, values: NDArray[T]) -> NDArray[T]:
        """(..., G) greatest of (..., K) values in each group."""
        most: NDArray[T] = np.maximum.reduceat(values, self.offsets[:-1], axis=-1)
        return most

    def mean(self, values: Real) -> Float64:
        """(G,) mean of (K,) values in each group."""
        total: Float64 = np.add.reduceat(values, self.offsets[:-1], dtype=np.float64)
        return total / self.count
