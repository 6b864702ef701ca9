"""Quantiles of many values in bounded memory."""

from __future__ import annotations

from collections import Counter

import numpy as np

MAX_EXACT = 4096
"""Distinct values held exactly by default."""
_BITS = 8
"""Leading bits held of each value beyond that."""


class Histogram:
    """Count, sum, maximum and quantiles of non-negative integers.

    Count, sum and maximum are exact. Quantiles are exact up to `max_exact` distinct values; then each value is
    replaced by the middle of those that share its _BITS leading bits, an error below 1 / 256. Integers of 63 bits
    have fewer than 8,000 such middles, which bounds the memory.
    """

    def __init__(self, max_exact: int = MAX_EXACT) -> None:
        self.count = self.total = self.maximum = 0
        self._max_exact = max_exact
        self._occurrences: Counter[int] = Counter()
        self._exact = True

    def __len__(self) -> int:
        """Distinct values held."""
        return len(self._occurrences)

    def add(self, value: int) -> None:
        """Add one value."""
        self.count += 1
        self.total += value
        self.maximum = max(self.maximum, value)
        self._occurrences[value if self._exact else bucket_middle(value)] += 1
        if self._exact and len(self) > self._max_exact:
            self._exact = False
            exact, self._occurrences = self._occurrences, Counter()
            for each, occurrences in exact.items():
                self._occurrences[bucket_middle(each)] += occurrences

    def occurrences(self) -> dict[str, list[int]]:
        """The distinct values held, in order, and how often each occurred."""
        values = sorted(self._occurrences)
        return {"values": values, "counts": [self._occurrences[value] for value in values]}

    @property
    def mean(self) -> float:
        """Mean of all values."""
        return self.total / self.count

    def quantile(self, share: float) -> float:
        """Quantile at that share, interpolated between neighbouring values."""
        values = np.array(sorted(self._occurrences))
        ends = np.cumsum([self._occurrences[value] for value in values.tolist()])
        below, part = divmod(share * (self.count - 1), 1.0)
        low, high = values[np.searchsorted(ends, [below, min(below + 1, self.count - 1)], side="right")]
        return min(float(low + part * (high - low)), float(self.maximum))


def bucket_middle(value: int) -> int:
    """Middle of all integers of this length that share its leading bits."""
    dropped = max(value.bit_length() - _BITS, 0)
    return (value >> dropped << dropped) + (1 << dropped >> 1)
