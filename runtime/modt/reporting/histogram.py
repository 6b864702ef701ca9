"""How long something took, time after time, in bounded memory."""

from __future__ import annotations

from collections import Counter

import numpy as np

EXACT = 4096
"""Different values that are kept as they are."""
BITS = 8
"""Leading bits that are kept of each once there are more."""


class Spread:
    """Count, sum, greatest and quantiles of whole numbers from 0 on.

    Count, sum and greatest are exact. Quantiles are exact up to EXACT different values; from then on they are off by
    less than 0.4 % (1 / 256), since every value is cut to its BITS leading bits and stands for the middle of what was
    cut off. There are fewer than 8,000 such numbers in 63 bits, so no more is ever held.
    """

    def __init__(self) -> None:
        self.count = self.total = self.greatest = 0
        self._times: Counter[int] = Counter()
        self._cutting = False

    def __len__(self) -> int:
        """Different values held."""
        return len(self._times)

    def add(self, value: int) -> None:
        """One more."""
        self.count += 1
        self.total += value
        self.greatest = max(self.greatest, value)
        self._times[cut(value) if self._cutting else value] += 1
        if len(self) > EXACT and not self._cutting:
            self._cutting = True
            whole, self._times = self._times, Counter()
            for seen, times in whole.items():
                self._times[cut(seen)] += times

    @property
    def mean(self) -> float:
        """Of all."""
        return self.total / self.count

    def quantile(self, share: float) -> float:
        """Value below which that share of all lies, interpolated between the two around it."""
        values = np.array(sorted(self._times))
        ends = np.cumsum([self._times[value] for value in values.tolist()])
        below, part = divmod(share * (self.count - 1), 1.0)
        low, high = values[np.searchsorted(ends, [below, min(below + 1, self.count - 1)], side="right")]
        return min(float(low + part * (high - low)), float(self.greatest))


def cut(value: int) -> int:
    """The middle of all whole numbers that share the BITS leading bits of this one, and its length."""
    lost = max(value.bit_length() - BITS, 0)
    return (value >> lost << lost) + (1 << lost >> 1)
