"""Quantiles of many values in bounded memory."""

from __future__ import annotations

from collections import Counter

import numpy as np

from modt.types import Int

BITS = 8
"""Leading bits held of each value. Values below 256 are exact, quantiles of greater ones within 0.4 %."""


class Histogram:
    """Count, sum, maximum and quantiles of integers. Negative ones count as 0.

    Count, sum and maximum are exact. For quantiles each value is replaced by the middle of those that share its
    leading `bits`, an error of at most 2^-bits. Integers of 63 bits have fewer than 2^(bits - 1) (65 - bits) such
    middles, which bounds the memory.
    """

    def __init__(self, bits: int = BITS) -> None:
        self.count = 0
        self.total = 0
        self.maximum = 0
        self._bits = bits
        self._occurrences: Counter[int] = Counter()

    def add(self, value: int) -> None:
        """Add one value."""
        value = max(value, 0)
        self.count += 1
        self.total += value
        self.maximum = max(self.maximum, value)
        dropped = max(value.bit_length() - self._bits, 0)
        self._occurrences[(value >> dropped << dropped) + (1 << dropped >> 1)] += 1

    def occurrences(self) -> dict[str, list[int]]:
        """Distinct values that are held, in order, and how often each occurred."""
        values, counts = self._sorted()
        return {"values": values.tolist(), "counts": counts.tolist()}

    @property
    def mean(self) -> float:
        """Mean of all values, 0 without values."""
        return self.total / max(self.count, 1)

    def quantile(self, share: float) -> float:
        """Quantile at that share, interpolated between neighbouring values, 0 without values."""
        if not self.count:
            return 0.0
        values, counts = self._sorted()
        below, part = divmod(share * (self.count - 1), 1.0)
        ranks = [below, min(below + 1, self.count - 1)]
        low, high = values[np.searchsorted(np.cumsum(counts), ranks, side="right")]
        return min(float(low + part * (high - low)), float(self.maximum))

    def figures(self, unit: float, **shares: float) -> dict[str, float]:
        """Mean, quantiles at the named shares and maximum, divided by a unit."""
        quantiles = {name: self.quantile(share) / unit for name, share in shares.items()}
        return {"mean": self.mean / unit, **quantiles, "max": self.maximum / unit}

    def _sorted(self) -> tuple[Int, Int]:
        """(V,) distinct values in order, and (V,) how often each occurred."""
        held = np.array(sorted(self._occurrences.items()), np.int64).reshape(-1, 2)
        return held[:, 0], held[:, 1]
